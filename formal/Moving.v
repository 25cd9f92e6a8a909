(** What the input takes while sliding variables move: instants and pieces of the time, and what is added up over them. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Certificate Checker Flow Sound Slide Solution Exist Input Effort Peak Reach Driven.
Open Scope R_scope.

(** * Numbers *)
Lemma ceil_ok q : Q2R q <= Q2R (ceil q).
Proof. unfold ceil. rewrite Q2R_opp. pose proof (floor_ok (- q)) as H. rewrite Q2R_opp in H. lra. Qed.
Lemma root_ok q : 0 <= Q2R q -> 0 <= Q2R (root q) /\ Q2R q <= sq (Q2R (root q)).
Proof.
  intros H. unfold root. destruct (Qle_bool q 0) eqn:E0.
  { apply Qle_bool_iff, Qle_Rle in E0. rewrite Q2R_0 in *. unfold sq. lra. }
  cbv zeta. set (r := (2 ^ 120)%Z). assert (Hr : (0 < r)%Z) by (unfold r; reflexivity). clearbody r.
  set (n := (Qnum q * (r * r) / Zpos (Qden q))%Z).
  assert (Hq : (0 <= Qnum q)%Z).
  { apply le_IZR. unfold Q2R in H. assert (P : 0 < IZR (Zpos (Qden q))) by (apply IZR_lt; reflexivity).
    apply Rnot_lt_le. intros C. assert (IZR (Qnum q) * / IZR (Zpos (Qden q)) < 0 * / IZR (Zpos (Qden q))).
    { apply Rmult_lt_compat_r; [apply Rinv_0_lt_compat; exact P|exact C]. } lra. }
  assert (N : (0 <= n)%Z) by (apply Z.div_pos; [nia|reflexivity]).
  pose proof (Z.sqrt_spec n N) as [_ B]. pose proof (Z.sqrt_nonneg n) as S0. set (m := Z.sqrt n) in *.
  pose proof (Z.mul_succ_div_gt (Qnum q * (r * r)) (Zpos (Qden q)) eq_refl) as D. fold n in D.
  assert (Z1 : (Qnum q * (r * r) < Zpos (Qden q) * ((m + 1) * (m + 1)))%Z) by nia.
  rewrite Q2R_div, !Q2R_inject by (unfold Qeq; cbn [Qnum Qden inject_Z]; lia).
  apply IZR_lt in Z1, Hr. rewrite !mult_IZR in Z1. assert (P : 0 < IZR (Zpos (Qden q))) by (apply IZR_lt; reflexivity).
  assert (M : 0 <= IZR (m + 1)) by (apply IZR_le; lia). set (x := IZR (m + 1)) in *. set (y := IZR r) in *. split.
  - apply Rmult_le_pos; [exact M|left; apply Rinv_0_lt_compat; exact Hr].
  - unfold sq, Q2R. apply (Rmult_le_reg_l (IZR (Zpos (Qden q)) * (y * y))); [apply Rmult_lt_0_compat; [exact P|]; apply Rmult_lt_0_compat; exact Hr|].
    replace (IZR (Zpos (Qden q)) * (y * y) * (x / y * (x / y))) with (IZR (Zpos (Qden q)) * (x * x)) by (field; lra).
    replace (IZR (Zpos (Qden q)) * (y * y) * (IZR (Qnum q) * / IZR (Zpos (Qden q)))) with (IZR (Qnum q) * (y * y)) by (field; lra). lra.
Qed.
Lemma Qle_ok a b : Qle_bool a b = true -> Q2R a <= Q2R b.
Proof. intros H. apply Qle_Rle, Qle_bool_iff. exact H. Qed.
Lemma Qle_no a b : Qle_bool a b = false -> Q2R b < Q2R a.
Proof. intros H. apply Qlt_Rlt, Qnot_le_lt. intros C. apply Qle_bool_iff in C. congruence. Qed.
Lemma pos_no q : pos q = false -> Q2R q <= 0.
Proof.
  intros H. apply Z.ltb_ge in H. unfold Q2R. apply IZR_le in H. assert (P : 0 < / IZR (Zpos (Qden q))) by (apply Rinv_0_lt_compat, IZR_lt; reflexivity). nra.
Qed.
Lemma Q2R_1 : Q2R 1 = 1. Proof. apply RMicromega.Q2R_1. Qed.
Lemma Q2R_2 : Q2R 2 = 2. Proof. unfold Q2R; simpl; lra. Qed.
Lemma logs_ok x y n a b : logs x y n = Some (a, b) -> 0 < Q2R x -> 0 <= Q2R a <= ln (Q2R x) /\ ln (Q2R x) <= Q2R b.
Proof.
  unfold logs. cbv zeta. set (e := (1 # 2 ^ 80)%Q). set (m := newton x y n). set (u := if Qle_bool e m then (m - e)%Q else 0%Q).
  intros H Hx. destruct (_ && _) eqn:E; [|discriminate]. injection H as <- <-. set (v := (m + e)%Q) in *.
  apply andb_prop in E as [E E5]. apply andb_prop in E as [E E4]. apply andb_prop in E as [E E3]. apply andb_prop in E as [E1 E2].
  apply negb_true_iff in E2. apply notneg_Q in E1, E4. apply Qle_ok in E3, E5. pose proof (above_ok u E1 E2) as A.
  destruct (horner_ok v 100 E4) as [_ B]. assert (LX : forall p q, 0 < p -> p <= q -> ln p <= ln q).
  { intros p q Hp [L| ->]; [left; apply ln_increasing; assumption|lra]. }
  split; [split; [exact E1|]|].
  - rewrite <- (ln_exp (Q2R u)). apply LX; [apply exp_pos|lra].
  - rewrite <- (ln_exp (Q2R v)). apply LX; [exact Hx|lra].
Qed.
Lemma exp_below x y : 0 <= Q2R x -> Q2R x <= y -> exp (- y) <= / Q2R (horner x 0 100).
Proof.
  intros Hx H. destruct (horner_ok x 100 Hx) as [A B]. rewrite exp_Ropp. apply Rinv_le_contravar; [lra|]. eapply Rle_trans; [exact B|].
  destruct H as [H| ->]; [left; apply exp_increasing; exact H|lra].
Qed.

Lemma twice_4_ok q : Q2R (twice_4 q) = Q2R q ^ 16.
Proof. unfold twice_4. cbv zeta. rewrite !Q2R_mult. ring. Qed.
Lemma exp_16 x : exp x = exp (x / 16) ^ 16.
Proof. simpl. rewrite Rmult_1_r, <- !exp_plus. f_equal. field. Qed.
Lemma sixteenth p : Q2R (p / 16) = Q2R p / 16.
Proof. rewrite Q2R_div by (apply nonzero; unfold Q2R; simpl; lra). f_equal. unfold Q2R; simpl; lra. Qed.
Lemma power_ok p : 0 <= Q2R p -> Qle_bool 1 (term (p / 16) 0 101) = false -> exp (Q2R p) <= Q2R (twice_4 (ceil (above (p / 16)))).
Proof.
  intros Hp HT. rewrite twice_4_ok, exp_16. apply pow_incr. split; [left; apply exp_pos|]. rewrite <- sixteenth.
  eapply Rle_trans; [apply above_ok; [rewrite sixteenth; lra|exact HT]|apply ceil_ok].
Qed.
Lemma power_below q x : 0 <= Q2R (floor q) -> Q2R q <= exp (x / 16) -> Q2R (twice_4 (floor q)) <= exp x.
Proof. intros F0 H. rewrite twice_4_ok, exp_16. apply pow_incr. split; [exact F0|]. eapply Rle_trans; [apply floor_ok|exact H]. Qed.

Section Instants.
Variables (c : cert) (T_r T_s mu1 mu2 mu3 delta : Q).
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hkind : kind c = SlidingMode T_r T_s mu1 mu2 mu3 delta.
Let T := deadline c.
Let Tr := Q2R T_r.
Let m := (mu3 * kappa c)%Q.
Let left_at := left_of c T_r mu2 mu3.
Lemma times : 0 < Tr < T /\ 0 < Q2R T_s /\ T = Tr + Q2R T_s.
Proof.
  destruct (parts c T_r T_s mu1 mu2 mu3 delta Hprot Hkind) as [A _].
  assert (E : T = Tr + Q2R T_s) by (unfold T, deadline; rewrite Hkind; reflexivity). unfold T, Tr in *. lra.
Qed.
Definition stands (i : instant) : Prop := 0 <= Q2R (time i) < T /\ Q2R (portion i) = (T - Q2R (time i)) / T /\
  Q2R (fst (passed i)) <= ln (T / (T - Q2R (time i))) <= Q2R (snd (passed i)) /\
  Q2R (fst (drop i)) <= left_at (Q2R (time i)) <= Q2R (snd (drop i)).
Lemma instant_ok z i : instant_at T_r T_s mu2 m z = Some i -> stands i.
Proof.
  destruct times as [A [B ET]]. destruct (parts c T_r T_s mu1 mu2 mu3 delta Hprot Hkind) as [_ [_ [P2 Pm]]].
  unfold instant_at. cbv zeta. set (q := floor (/ above z)). set (x := (((T_r + T_s) * q - T_s) / T_r)%Q).
  set (t := ((T_r + T_s) * (1 - q))%Q). intros H.
  destruct (pos q && Qle_bool q 1) eqn:E; [|discriminate]. apply andb_prop in E as [E1 E2]. apply pos_Q in E1. apply Qle_ok in E2. rewrite Q2R_1 in E2.
  destruct (logs (/ q) z 0) as [[la lb]|] eqn:EL; [|discriminate].
  assert (Et : Q2R t = T * (1 - Q2R q)) by (unfold t; rewrite Q2R_mult, Q2R_plus, Q2R_minus, Q2R_1; rewrite ET; reflexivity).
  assert (Ht : 0 <= Q2R t < T).
  { rewrite Et. assert (0 <= T * (1 - Q2R q)) by (apply Rmult_le_pos; lra). assert (0 < T * Q2R q) by (apply Rmult_lt_0_compat; lra). lra. }
  assert (Eq : Q2R q = (T - Q2R t) / T) by (rewrite Et; field; lra).
  assert (El : Q2R (/ q) = T / (T - Q2R t)).
  { rewrite Q2R_inv by (apply nonzero; lra). rewrite Et. replace (T - T * (1 - Q2R q)) with (T * Q2R q) by ring. field. lra. }
  destruct (logs_ok _ _ _ _ _ EL) as [L1 L2]. { rewrite El. apply Rdiv_lt_0_compat; lra. } rewrite El in L1, L2.
  assert (Ex : Q2R x = (Tr - Q2R t) / Tr).
  { unfold x. rewrite Q2R_div by (apply nonzero; unfold Tr in A; lra). rewrite Q2R_minus, Q2R_mult, Q2R_plus, Et, ET. unfold Tr. field. unfold Tr in A; lra. }
  destruct (pos x) eqn:Ep.
  - apply pos_Q in Ep. assert (Lt : Q2R t < Tr).
    { rewrite Ex in Ep. apply (Rmult_lt_compat_r Tr) in Ep; [|lra]. unfold Rdiv in Ep. rewrite Rmult_assoc, Rinv_l in Ep by lra. lra. }
    set (o := if Qle_bool 1 x then _ else _) in H. destruct o as [[a b]|] eqn:EO; [|discriminate].
    assert (LA : 0 <= Q2R a <= - ln (Q2R x) /\ - ln (Q2R x) <= Q2R b).
    { subst o. destruct (Qle_bool 1 x) eqn:E3.
      - injection EO as <- <-. apply Qle_ok in E3. rewrite Q2R_1 in E3. rewrite Q2R_0.
        assert (Q2R x <= 1).
        { rewrite Ex. apply (Rmult_le_reg_r Tr); [lra|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l; lra. }
        replace (Q2R x) with 1 by lra. rewrite ln_1. lra.
      - destruct (logs_ok _ _ _ _ _ EO) as [M1 M2]. { rewrite Q2R_inv by (apply nonzero; lra). apply Rinv_0_lt_compat. exact Ep. }
        rewrite Q2R_inv in M1, M2 by (apply nonzero; lra). rewrite ln_Rinv in M1, M2 by exact Ep. lra. }
    set (low := floor (mu2 * t + m * a)) in *. set (high := ceil (mu2 * t + m * b)) in *.
    destruct (notneg low && _ && _) eqn:E4 in H; [|discriminate]. injection H as <-.
    apply andb_prop in E4 as [E4 E6]. apply andb_prop in E4 as [E4 E5]. apply negb_true_iff in E6. apply notneg_Q in E4, E5.
    unfold stands. cbn [time portion passed drop fst snd]. split; [exact Ht|]. split; [exact Eq|]. split; [lra|].
    set (y := Q2R mu2 * Q2R t + Q2R m * - ln (Q2R x)).
    assert (EW : left_at (Q2R t) = exp (- y)).
    { unfold left_at, left_of. fold Tr. destruct (Rlt_dec (Q2R t) Tr); [|lra]. unfold psi, Rpower. fold Tr. rewrite <- Ex, <- exp_plus.
      f_equal. unfold y, m. rewrite Q2R_mult. ring. }
    assert (Hm : 0 < Q2R m) by (unfold m; rewrite Q2R_mult; exact Pm).
    assert (Y1 : Q2R low <= y).
    { eapply Rle_trans; [apply floor_ok|]. rewrite Q2R_plus, !Q2R_mult. unfold y. apply Rplus_le_compat_l. apply Rmult_le_compat_l; lra. }
    assert (Y2 : y <= Q2R high).
    { eapply Rle_trans; [|apply ceil_ok]. rewrite Q2R_plus, !Q2R_mult. unfold y. apply Rplus_le_compat_l. apply Rmult_le_compat_l; lra. }
    rewrite EW. destruct (horner_ok low 100 E4) as [G1 _]. pose proof (power_ok high E5 E6) as G2. pose proof (exp_pos (Q2R high)) as G3. split.
    + eapply Rle_trans; [apply floor_ok|]. rewrite Q2R_inv by (apply nonzero; lra). eapply Rle_trans; [apply Rinv_le_contravar; [exact G3|exact G2]|].
      rewrite <- exp_Ropp. destruct Y2 as [Y2|Y2]; [left; apply exp_increasing; lra|right; f_equal; lra].
    + eapply Rle_trans; [apply (exp_below low y E4 Y1)|]. rewrite <- Q2R_inv by (apply nonzero; lra). apply ceil_ok.
  - injection H as <-. apply pos_no in Ep. assert (Lt : ~ Q2R t < Tr).
    { intros C. rewrite Ex in Ep. assert (0 < (Tr - Q2R t) / Tr) by (apply Rdiv_lt_0_compat; lra). lra. }
    unfold stands. cbn [time portion passed drop fst snd]. split; [exact Ht|]. split; [exact Eq|]. split; [lra|].
    unfold left_at, left_of. fold Tr. destruct (Rlt_dec (Q2R t) Tr); [contradiction|]. rewrite Q2R_0. lra.
Qed.
Opaque instant_at.
Lemma instants_ok z : forall j l, instants T_r T_s mu2 m z j = Some l -> l <> [] /\ forall i, In i l -> stands i.
Proof.
  induction j as [|j IH]; intros l H; cbn [instants] in H;
    destruct (instant_at _ _ _ _ _) as [a|] eqn:E; try discriminate; pose proof (instant_ok _ _ E) as Sa.
  - injection H as <-. split; [discriminate|]. intros i [<-|[]]. exact Sa.
  - destruct (instants T_r T_s mu2 m z j) as [l'|] eqn:E'; [|discriminate]. injection H as <-. destruct (IH _ eq_refl) as [_ K].
    split; [discriminate|]. intros i [<-|Hi]; [exact Sa|apply K; exact Hi].
Qed.
Transparent instant_at.

(** * Pieces *)
Let r1 := Q2R (rho1 c).
Let kk := k c.
Let gain := gain T r1 kk.
Let s := s c.
Let pos3 : 0 < T /\ 0 < r1 /\ 0 < kk := Driven.positive c T_r T_s mu1 mu2 mu3 delta Hprot Hkind.
(** the integral of the square of the gain *)
Definition squared t := r1 * r1 * t + 2 * r1 * kk * ln (T / (T - t)) + kk * kk / (T - t).
Lemma squared_derive t : t < T -> is_derive squared t (gain t * gain t).
Proof.
  intros Ht. destruct pos3 as [P1 [P2 P3]]. unfold squared, gain, Certificate.gain. auto_derive.
  - repeat split; try lra. apply Rmult_lt_0_compat; [exact P1|]. apply Rinv_0_lt_compat. lra.
  - field. lra.
Qed.
Variables (U : R -> R) (r ww f : Q).
Hypotheses (Hr : 0 < Q2R r) (Hw : 0 <= Q2R ww) (Hf : 0 <= Q2R f).
Hypothesis U0 : forall t, 0 <= U t.
Hypothesis HU : forall a t, 0 <= a <= t -> t < T -> U t <= exp (- (Q2R r / 2 * (s t - s a))) * U a + Q2R ww * (left_at a - left_at t) + Q2R f * (t - a).
Definition holds_in (p : stretch) (a b : R) : Prop := 0 <= a <= b /\ b < T /\
  (forall t, a <= t <= b -> U t <= Q2R (size_in p) /\ (2 <= kk * Q2R r -> gain t * U t <= Q2R (peak_in p))) /\
  s b - s a <= Q2R (clock_in p) /\ squared b - squared a <= Q2R (square_in p).
Fixpoint covers (l : list stretch) (a e : R) : Prop := match l with [] => a = e | p :: l' => exists b, holds_in p a b /\ covers l' b e end.
Lemma gain_ok i : stands i -> Q2R (gain_at c i) = gain (Q2R (time i)).
Proof.
  intros [A [B _]]. destruct pos3 as [P1 [P2 P3]]. unfold gain_at. assert (ET : Q2R (span c) = T) by apply span_ok.
  assert (Hs : 0 < Q2R (portion i)) by (rewrite B; apply Rdiv_lt_0_compat; lra).
  rewrite Q2R_plus, Q2R_div by (apply nonzero; rewrite Q2R_mult, ET; apply Rgt_not_eq, Rmult_lt_0_compat; assumption).
  rewrite !Q2R_mult, ET, B. unfold gain, Certificate.gain, kk, k. fold r1. f_equal. field. lra.
Qed.
Lemma clock_mono a t : 0 <= a <= t -> t < T -> s a <= s t.
Proof. intros. apply (clock_grows c T_r T_s mu1 mu2 mu3 delta Hprot Hkind a t); assumption. Qed.
Lemma decay_1 y a t : 0 <= y -> 0 <= a <= t -> t < T -> exp (- (y * (s t - s a))) <= 1.
Proof.
  intros Hy Ha Ht. rewrite <- exp_0. pose proof (clock_mono a t Ha Ht) as M. assert (0 <= y * (s t - s a)) by (apply Rmult_le_pos; lra).
  destruct (Req_dec (y * (s t - s a)) 0) as [->|N]; [rewrite Ropp_0; lra|]. left. apply exp_increasing. lra.
Qed.
Lemma gain_decays a t : 2 <= kk * Q2R r -> 0 <= a <= t -> t < T -> gain t * exp (- (Q2R r / 2 * (s t - s a))) <= gain a.
Proof.
  intros H2 Ha Ht. destruct pos3 as [P1 [P2 P3]]. pose proof (gain_falls T r1 kk (Q2R r) a t P1 P2 P3 H2 Ha Ht) as F.
  assert (G1 : 0 < gain t) by (apply gain_pos; lra). assert (G2 : 0 < gain a) by (apply gain_pos; lra).
  fold gain in F. change (clock T r1 kk t) with (s t) in F. change (clock T r1 kk a) with (s a) in F.
  set (x := exp (- (Q2R r / 2 * (s t - s a)))). assert (X : 0 < x) by apply exp_pos.
  assert (E : exp (- (Q2R r * s t)) = x * x * exp (- (Q2R r * s a))) by (unfold x; rewrite <- !exp_plus; f_equal; field).
  rewrite E in F. pose proof (exp_pos (- (Q2R r * s a))) as Y. set (y := exp (- (Q2R r * s a))) in *.
  assert (Q : sq (gain t * x) <= sq (gain a)).
  { apply (Rmult_le_reg_r y); [exact Y|]. unfold sq in *. lra. }
  assert (0 < gain t * x) by (apply Rmult_lt_0_compat; assumption). unfold sq in Q. nra.
Qed.
Lemma stretch_ok a b v : stands a -> stands b -> Q2R (time a) <= Q2R (time b) -> U (Q2R (time a)) <= Q2R v ->
  let p := stretch_of c r ww f v a b in holds_in (fst p) (Q2R (time a)) (Q2R (time b)) /\ U (Q2R (time b)) <= Q2R (snd p).
Proof.
  intros Sa Sb Hab Hv. destruct pos3 as [P1 [P2 P3]]. unfold stretch_of. cbv zeta. cbn [fst snd].
  pose proof (gain_ok a Sa) as Ga. pose proof (gain_ok b Sb) as Gb.
  destruct Sa as [A1 [A2 [A3 A4]]]. destruct Sb as [B1 [B2 [B3 B4]]].
  set (ta := Q2R (time a)) in *. set (tb := Q2R (time b)) in *.
  set (g := ceil (ww * (snd (drop a) - fst (drop b)) + f * (time b - time a))).
  set (y := floor (r / 2 * (rho1 c * (time b - time a) + rho2 c * kappa c * (fst (passed b) - snd (passed a))))).
  assert (Eg : Q2R ww * (left_at ta - left_at tb) + Q2R f * (tb - ta) <= Q2R g).
  { eapply Rle_trans; [|apply ceil_ok]. rewrite Q2R_plus, !Q2R_mult, !Q2R_minus. apply Rplus_le_compat_r. apply Rmult_le_compat_l; lra. }
  assert (Hg : forall t, ta <= t <= tb -> Q2R ww * (left_at ta - left_at t) + Q2R f * (t - ta) <= Q2R g).
  { intros t Ht. eapply Rle_trans; [|exact Eg]. pose proof (left_falls c T_r T_s mu1 mu2 mu3 delta Hprot Hkind t tb ltac:(lra)) as L. fold left_at in L.
    apply Rplus_le_compat; apply Rmult_le_compat_l; lra. }
  assert (g0 : 0 <= Q2R g) by (specialize (Hg ta ltac:(lra)); rewrite !Rminus_eq_0, !Rmult_0_r in Hg; lra).
  pose proof (U0 ta) as Ua. assert (v0 : 0 <= Q2R v) by lra.
  assert (HUt : forall t, ta <= t <= tb -> U t <= exp (- (Q2R r / 2 * (s t - s ta))) * Q2R v + Q2R g).
  { intros t Ht. specialize (HU ta t ltac:(lra) ltac:(lra)). specialize (Hg t Ht). pose proof (exp_pos (- (Q2R r / 2 * (s t - s ta)))) as X.
    assert (exp (- (Q2R r / 2 * (s t - s ta))) * U ta <= exp (- (Q2R r / 2 * (s t - s ta))) * Q2R v) by (apply Rmult_le_compat_l; lra). lra. }
  assert (EP : Q2R (rho2 c * kappa c) = kk) by apply Q2R_mult.
  assert (LT : forall t, s t = r1 * t + kk * ln (T / (T - t))) by reflexivity.
  assert (KL : kk * ln (T / (T - tb)) - kk * ln (T / (T - ta)) <= kk * (Q2R (snd (passed b)) - Q2R (fst (passed a)))).
  { rewrite <- Rmult_minus_distr_l. apply Rmult_le_compat_l; lra. }
  split; [split; [lra|split; [lra|split; [|split]]]|].
  - intros t Ht. cbn [size_in peak_in]. rewrite Q2R_plus. specialize (HUt t Ht). split.
    + pose proof (decay_1 (Q2R r / 2) ta t ltac:(lra) ltac:(lra) ltac:(lra)) as D.
      assert (exp (- (Q2R r / 2 * (s t - s ta))) * Q2R v <= 1 * Q2R v) by (apply Rmult_le_compat_r; assumption). lra.
    + intros H2. rewrite Q2R_plus, !Q2R_mult, Ga, Gb. assert (G : 0 < gain t) by (apply gain_pos; lra).
      pose proof (gain_decays ta t H2 ltac:(lra) ltac:(lra)) as D.
      assert (M : gain t <= gain tb) by (apply gain_grows; lra).
      eapply Rle_trans; [apply Rmult_le_compat_l; [lra|exact HUt]|]. rewrite Rmult_plus_distr_l, <- Rmult_assoc.
      apply Rplus_le_compat; apply Rmult_le_compat_r; lra.
  - cbn [clock_in]. eapply Rle_trans; [|apply ceil_ok]. rewrite Q2R_plus, (Q2R_mult (rho1 c)), (Q2R_mult (rho2 c * kappa c)), EP, !Q2R_minus.
    rewrite !LT. fold r1 ta tb. lra.
  - cbn [square_in].
    assert (Sp : forall i, Q2R (portion i) = (T - Q2R (time i)) / T -> Q2R (time i) < T -> Q2R (/ portion i) = T / (T - Q2R (time i))).
    { intros i Ei Hi. rewrite Q2R_inv by (apply nonzero; rewrite Ei; apply Rgt_not_eq, Rdiv_lt_0_compat; lra). rewrite Ei. field. lra. }
    pose proof (Sp a A2 ltac:(fold ta; lra)) as Ia. pose proof (Sp b B2 ltac:(fold tb; lra)) as Ib. fold ta in Ia. fold tb in Ib.
    assert (ET : Q2R (span c) = T) by apply span_ok.
    eapply Rle_trans; [|apply ceil_ok]. set (kq := (rho2 c * kappa c)%Q) in *. rewrite !Q2R_plus, !Q2R_mult, Q2R_div, !Q2R_mult, EP, !Q2R_minus, Ia, Ib, ET, Q2R_2 by (apply nonzero; rewrite ET; lra).
    fold r1. unfold squared. fold ta tb.
    assert (Q : 2 * r1 * (kk * ln (T / (T - tb)) - kk * ln (T / (T - ta))) <= 2 * r1 * (kk * (Q2R (snd (passed b)) - Q2R (fst (passed a))))) by (apply Rmult_le_compat_l; lra).
    replace (kk * kk / T * (T / (T - tb) - T / (T - ta))) with (kk * kk / (T - tb) - kk * kk / (T - ta)) by (field; lra). lra.
  - set (y' := if notneg y then y else 0%Q). assert (Hy : 0 <= Q2R y' /\ Q2R y' <= Q2R r / 2 * (s tb - s ta)).
    { assert (N : 0 <= Q2R r / 2 * (s tb - s ta)) by (apply Rmult_le_pos; [lra|]; pose proof (clock_mono ta tb ltac:(lra) ltac:(lra)); lra).
      unfold y'. destruct (notneg y) eqn:Ey; [|rewrite Q2R_0; lra]. split; [apply notneg_Q; exact Ey|]. unfold y.
      eapply Rle_trans; [apply floor_ok|]. rewrite Q2R_mult, Q2R_div, Q2R_2 by (apply nonzero; rewrite Q2R_2; lra). apply Rmult_le_compat_l; [lra|].
      rewrite Q2R_plus, (Q2R_mult (rho1 c)), (Q2R_mult (rho2 c * kappa c)), EP, !Q2R_minus, !LT. fold r1 ta tb.
      assert (kk * (Q2R (fst (passed b)) - Q2R (snd (passed a))) <= kk * (ln (T / (T - tb)) - ln (T / (T - ta)))) by (apply Rmult_le_compat_l; lra). lra. }
    destruct Hy as [Hy1 Hy2]. destruct (horner_ok y' 100 Hy1) as [Z1 _]. pose proof (exp_below y' _ Hy1 Hy2) as X.
    eapply Rle_trans; [|apply ceil_ok]. rewrite Q2R_plus, Q2R_div by (apply nonzero; lra).
    eapply Rle_trans; [apply HUt; lra|]. apply Rplus_le_compat_r. unfold Rdiv. rewrite (Rmult_comm (Q2R v)). apply Rmult_le_compat_r; assumption.
Qed.
Lemma run_ok : forall l a v, (forall i, In i (a :: l) -> stands i) -> follow (a :: l) = true -> U (Q2R (time a)) <= Q2R v ->
  forall e, let p := run c r ww f v (a :: l) in
  covers (fst p) (Q2R (time a)) (Q2R (time (List.last (a :: l) e))) /\ U (Q2R (time (List.last (a :: l) e))) <= Q2R (snd p).
Proof.
  induction l as [|b l IH]; intros a v Hs Hf' Hv e; [split; [reflexivity|exact Hv]|].
  change (run c r ww f v (a :: b :: l)) with (let p := stretch_of c r ww f v a b in let q := run c r ww f (snd p) (b :: l) in (fst p :: fst q, snd q)).
  change (follow (a :: b :: l)) with (Qle_bool (time a) (time b) && follow (b :: l)) in Hf'. apply andb_prop in Hf' as [F1 F2]. apply Qle_ok in F1.
  destruct (stretch_ok a b v (Hs a ltac:(left; reflexivity)) (Hs b ltac:(right; left; reflexivity)) F1 Hv) as [S1 S2]. cbv zeta in *.
  destruct (IH b _ ltac:(intros i Hi; apply Hs; right; exact Hi) F2 S2 e) as [C1 C2].
  change (List.last (a :: b :: l) e) with (List.last (b :: l) e). cbn [fst snd]. split; [|exact C2]. exists (Q2R (time b)). split; assumption.
Qed.
End Instants.
