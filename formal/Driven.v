(** While sliding variables move: how far they drive anything that measures the state and shrinks along the motion. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Certificate Checker Flow Sound Slide Solution Exist Effort Peak Reach.
Open Scope R_scope.

(** * What holds of each agent soon after an instant holds of all *)
Lemma soon_all n (P : R -> nat -> Prop) : (forall i, (i < n)%nat -> exists e, 0 < e /\ forall h, 0 < h < e -> P h i) ->
  exists e, 0 < e /\ forall h, 0 < h < e -> forall i, (i < n)%nat -> P h i.
Proof.
  induction n as [|n IH]; intros H; [exists 1; split; [lra|]; intros; lia|].
  destruct IH as [a [A Ha]]; [intros; apply H; lia|]. destruct (H n) as [b [B Hb]]; [lia|].
  exists (Rmin a b). split; [apply Rmin_pos; assumption|]. intros h Hh i Hi. pose proof (Rmin_l a b). pose proof (Rmin_r a b).
  destruct (Nat.eq_dec i n) as [->|]; [apply Hb; lra|apply Ha; [lra|lia]].
Qed.
Lemma largest_of n (x : nat -> R) : exists M, 0 <= M /\ forall i, (i < n)%nat -> Rabs (x i) <= M.
Proof.
  induction n as [|n [M [P H]]]; [exists 0; split; [lra|intros; lia]|]. exists (Rmax M (Rabs (x n))).
  split; [eapply Rle_trans; [exact P|apply Rmax_l]|]. intros i Hi. destruct (Nat.eq_dec i n) as [->|]; [apply Rmax_r|].
  eapply Rle_trans; [apply H; lia|apply Rmax_l].
Qed.
Lemma derive_near (f : R -> R) t l e : is_derive f t l -> 0 < e -> exists d, 0 < d /\ forall h, 0 < h < d -> Rabs (f (t + h) - f t - h * l) <= h * e.
Proof.
  intros D He. apply is_derive_Reals in D. destruct (D e He) as [d Hd]. exists d. split; [apply cond_pos|]. intros h Hh.
  specialize (Hd h ltac:(lra) ltac:(rewrite Rabs_right; lra)).
  replace (f (t + h) - f t - h * l) with (h * ((f (t + h) - f t) / h - l)) by (field; lra).
  rewrite Rabs_mult, Rabs_right by lra. apply Rmult_le_compat_l; lra.
Qed.
Definition sign (a : R) : R := if Rlt_dec 0 a then 1 else if Rlt_dec a 0 then -1 else 0.

Lemma psi_falls c T_r T_s mu1 mu2 mu3 delta : check_protocol c = true -> kind c = SlidingMode T_r T_s mu1 mu2 mu3 delta ->
  forall a u, a <= u -> u < Q2R T_r -> psi c T_r mu2 mu3 u <= psi c T_r mu2 mu3 a.
Proof.
  intros HP HK a u Ha Hu. set (w := psi c T_r mu2 mu3). set (p := pull c T_r mu2 mu3).
  apply (decreasing (Q2R T_r) a w (fun u => - (p u * w u))); [| | |lra]; intros v Hv.
  - apply (psi_derive c T_r T_s mu1 mu2 mu3 delta HP HK). lra.
  - apply @ex_derive_continuous. eexists. apply (psi_derive c T_r T_s mu1 mu2 mu3 delta HP HK). lra.
  - pose proof (psi_pos c T_r mu2 mu3 v) as P. fold w in P. pose proof (pull_pos c T_r T_s mu1 mu2 mu3 delta HP HK v) as Q. fold p in Q. nra.
Qed.
Definition left_of c T_r mu2 mu3 t : R := if Rlt_dec t (Q2R T_r) then psi c T_r mu2 mu3 t else 0.
Lemma left_falls c T_r T_s mu1 mu2 mu3 delta : check_protocol c = true -> kind c = SlidingMode T_r T_s mu1 mu2 mu3 delta ->
  forall a u, a <= u -> left_of c T_r mu2 mu3 u <= left_of c T_r mu2 mu3 a.
Proof.
  intros HP HK a u Ha. unfold left_of. destruct (Rlt_dec u (Q2R T_r)) as [L|L]; destruct (Rlt_dec a (Q2R T_r)) as [M|M]; try lra.
  - apply (psi_falls c T_r T_s mu1 mu2 mu3 delta HP HK); assumption.
  - left. apply psi_pos.
Qed.

Section Driven.
Variables (c : cert) (T_r T_s mu1 mu2 mu3 delta : Q).
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hkind : kind c = SlidingMode T_r T_s mu1 mu2 mu3 delta.
Let n := order c.
Let es := edges c.
Let T := deadline c.
Let Tr := Q2R T_r.
Let w := psi c T_r mu2 mu3.
Let p := pull c T_r mu2 mu3.
Let push := Q2R mu1 + Q2R delta.
Let above := parts c T_r T_s mu1 mu2 mu3 delta Hprot Hkind.
Let w_derive t : t < Tr -> is_derive w t (- (p t * w t)) := psi_derive c T_r T_s mu1 mu2 mu3 delta Hprot Hkind t.
Let w_pos t : 0 < w t := psi_pos c T_r mu2 mu3 t.
Variables (X S : R -> nat -> R).
Hypothesis HM : moves c X S.
Let law t i (Hi : (i < n)%nat) e := Slide.laws c T_r T_s mu1 mu2 mu3 delta Hkind X S i HM Hi t e.

(** a sliding variable keeps its sign until it is 0 *)
Lemma keeps_sign i t : (i < n)%nat -> 0 <= t < T -> 0 <= S t i * S 0 i.
Proof.
  intros Hi Ht. pose proof (stays 0 t (fun u => S (Rmax 0 u) i * S 0 i)) as K. cbv beta in K.
  rewrite (Rmax_right 0 t) in K by lra. apply K; [lra| | |].
  - intros u Hu. apply continuous_times; [|apply continuous_const]. pose proof HM as [[_ C] _]. apply C; [|exact Hi]. unfold T in Ht. lra.
  - rewrite Rmax_left by lra. apply Rle_0_sqr.
  - intros u Hu Z. rewrite Rmax_right in Z by lra. exists (T - u). split; [lra|]. intros h Hh. rewrite Rmax_right by lra.
    apply Rmult_integral in Z as [Z| ->]; [|rewrite Rmult_0_r; lra].
    rewrite (Reach.stays_0 c T_r T_s mu1 mu2 mu3 delta Hprot Hkind X S i HM Hi u (u + h)); [lra|lra|unfold T in *; lra|exact Z].
Qed.
(** it is a share of what [psi] leaves *)
Lemma share_of i t : (i < n)%nat -> 0 <= t < Tr -> exists a, 0 <= a <= w t /\ S t i = a * S 0 i.
Proof.
  intros Hi Ht. pose proof (Slide.shrinks c T_r T_s mu1 mu2 mu3 delta Hprot Hkind X S i HM Hi t Ht) as B. fold w in B.
  destruct above as [A _]. fold Tr T in A. pose proof (keeps_sign i t Hi ltac:(lra)) as K. pose proof (w_pos t) as P.
  destruct (Req_dec (S 0 i) 0) as [Z|N].
  - rewrite Z, Rabs_R0, Rmult_0_r in B. assert (E : S t i = 0).
    { destruct (Req_dec (S t i) 0) as [|Q]; [assumption|]. pose proof (Rabs_pos_lt _ Q). lra. }
    exists 0. split; [lra|]. rewrite E. ring.
  - exists (S t i / S 0 i). split; [|field; exact N]. assert (Q : 0 < S 0 i * S 0 i) by (apply Rsqr_pos_lt; exact N).
    replace (S t i / S 0 i) with (S t i * S 0 i / (S 0 i * S 0 i)) by (field; exact N). split.
    + apply Rmult_le_pos; [exact K|]. left. apply Rinv_0_lt_compat. exact Q.
    + apply (Rmult_le_reg_r (S 0 i * S 0 i)); [exact Q|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra.
      apply (Rmult_le_compat_r (Rabs (S 0 i))) in B; [|apply Rabs_pos]. rewrite <- Rabs_mult, Rmult_assoc, <- Rabs_mult in B.
      rewrite !Rabs_right in B by (apply Rle_ge; assumption || apply Rle_0_sqr). lra.
Qed.
Lemma sign_abs a : sign a * Rabs a = a.
Proof. unfold sign. destruct (Rlt_dec 0 a); [rewrite Rabs_right by lra; ring|]. destruct (Rlt_dec a 0); [rewrite Rabs_left by lra; ring|]. replace a with 0 by lra. ring. Qed.
(** what it loses soon: by [pull], and by the rest, which [mu1 + delta] bounds *)
Lemma loses i t e : (i < n)%nat -> 0 <= t < Tr -> 0 < e -> exists eta, 0 < eta /\ forall h, 0 < h < eta -> exists a b,
  0 <= a <= h * (p t * w t) /\ 0 <= b <= h * (push + e) /\ S (t + h) i - S t i = - (a * S 0 i) - b * sign (S 0 i).
Proof.
  intros Hi Ht He. destruct above as [A [M _]]. fold Tr T in A. pose proof (w_pos t) as P.
  pose proof (pull_pos c T_r T_s mu1 mu2 mu3 delta Hprot Hkind t) as Pp. fold p in Pp.
  destruct (share_of i t Hi Ht) as [q [Hq Eq]].
  destruct (Req_dec (S t i) 0) as [Z|N].
  - exists (Tr - t). split; [lra|]. intros h Hh. exists 0, 0. assert (0 <= h * (p t * w t)) by (apply Rmult_le_pos; [lra|]; apply Rmult_le_pos; lra).
    assert (G : 0 <= push) by (pose proof (delta_pos c T_r T_s mu1 mu2 mu3 delta Hprot Hkind); unfold push; lra).
    assert (0 <= h * (push + e)) by (apply Rmult_le_pos; lra). split; [lra|]. split; [lra|].
    rewrite Z. rewrite (Reach.stays_0 c T_r T_s mu1 mu2 mu3 delta Hprot Hkind X S i HM Hi t (t + h)); [ring|lra|unfold T in *; lra|exact Z].
  - set (e' := Rmin e (Q2R mu1 - Q2R delta)). assert (E' : 0 < e') by (apply Rmin_pos; lra).
    pose proof (Rmin_l e (Q2R mu1 - Q2R delta)) as Ea. pose proof (Rmin_r e (Q2R mu1 - Q2R delta)) as Eb. fold e' in Ea, Eb.
    destruct (law t i Hi e' ltac:(unfold T in *; lra) N E') as [eta [E H]]. exists (Rmin eta (T - t)).
    split; [apply Rmin_pos; lra|]. intros h Hh. pose proof (Rmin_l eta (T - t)). pose proof (Rmin_r eta (T - t)).
    specialize (H h ltac:(lra)). fold p in H. set (b := Rabs (S t i) - h * (p t * Rabs (S t i)) - Rabs (S (t + h) i)).
    exists (h * (p t * q)), b. assert (Z0 : S 0 i <> 0) by (intros Z; apply N; rewrite Eq, Z; ring).
    split; [|split].
    + split; [apply Rmult_le_pos; [lra|apply Rmult_le_pos; lra]|]. apply Rmult_le_compat_l; [lra|]. apply Rmult_le_compat_l; lra.
    + apply Rabs_le_between in H. unfold b, push. assert (h * e' <= h * e) by (apply Rmult_le_compat_l; lra).
      assert (0 <= h * (Q2R mu1 - Q2R delta - e')) by (apply Rmult_le_pos; lra). split; lra.
    + assert (K : forall u, 0 <= u < T -> S u i = sign (S 0 i) * Rabs (S u i)).
      { intros u Hu. pose proof (keeps_sign i u Hi Hu) as K. unfold sign. destruct (Rlt_dec 0 (S 0 i)) as [L|L].
        - assert (0 <= S u i) by nra. rewrite Rabs_right by lra. ring.
        - destruct (Rlt_dec (S 0 i) 0) as [L2|]; [|lra]. assert (S u i <= 0) by nra. rewrite Rabs_left1 by lra. ring. }
      rewrite (K (t + h)) at 1 by lra. replace (h * (p t * q) * S 0 i) with (h * (p t * S t i)) by (rewrite Eq; ring).
      rewrite (K t) at 1 2 by lra. unfold b. ring.
Qed.

(** * What measures the state *)
Variable U : (nat -> R) -> R.
Variables (r K ww f : R).
Hypotheses (Hr : 0 <= r) (HK : 0 <= K) (Hww : 0 <= ww) (Hf : 0 <= f).
Hypothesis U_pos : forall x, 0 <= U x.
Hypothesis U_plus : forall x y, U (fun i => x i + y i) <= U x + U y.
Hypothesis U_size : forall x M, 0 <= M -> (forall i, (i < n)%nat -> Rabs (x i) <= M) -> U x <= K * M.
Hypothesis U_falls : forall x, 0 < U x -> exists C a, 0 <= C /\ 0 < a /\
  forall y, 0 <= y <= a -> U (fun i => x i - y * lap es x i) <= U x - y * (r / 2 * U x) + C * (y * y).
Hypothesis U_share : forall M x, 0 <= M -> (forall i, (i < n)%nat -> exists a, 0 <= a <= M /\ x i = - (a * S 0 i)) -> U x <= M * ww.
Hypothesis U_sign : forall M x, 0 <= M -> (forall i, (i < n)%nat -> exists b, 0 <= b <= M * push /\ x i = - (b * sign (S 0 i))) -> U x <= M * f.
Lemma U_near x y M : 0 <= M -> (forall i, (i < n)%nat -> Rabs (x i - y i) <= M) -> U x <= U y + K * M.
Proof.
  intros HM0 H. assert (E : U x <= U (fun i => y i + (x i - y i)) + K * 0).
  { eapply Rle_trans; [|apply Rplus_le_compat_l, (U_size (fun i => x i - (y i + (x i - y i))) 0 (Rle_refl 0))].
    - eapply Rle_trans; [|apply (U_plus (fun i => y i + (x i - y i)) (fun i => x i - (y i + (x i - y i))))].
      right. f_equal. apply FunctionalExtensionality.functional_extensionality. intros i. ring.
    - intros i _. replace (x i - (y i + (x i - y i))) with 0 by ring. rewrite Rabs_R0. lra. }
  eapply Rle_trans; [exact E|]. rewrite Rmult_0_r, Rplus_0_r. eapply Rle_trans; [apply U_plus|].
  apply Rplus_le_compat_l. apply U_size; assumption.
Qed.
Let gain := gain T (Q2R (rho1 c)) (k c).
Let Y (t : R) := X (Rmax 0 t).
Lemma U_cont t : 0 <= t < T -> continuous (fun u => U (Y u)) t.
Proof.
  intros Ht. apply filterlim_locally. intros e. set (m := e / 2 / (K + 1)). pose proof (cond_pos e) as He.
  assert (Hm : 0 < m) by (unfold m; apply Rdiv_lt_0_compat; lra).
  assert (Em : K * m < e).
  { assert (E : (K + 1) * m = e / 2) by (unfold m; field; lra). lra. }
  assert (L : locally t (fun u => forall i, (i < n)%nat -> Rabs (Y u i - Y t i) < m)).
  { clear - HM Ht Hm. unfold n. assert (G : forall j, (j <= order c)%nat -> locally t (fun u => forall i, (i < j)%nat -> Rabs (Y u i - Y t i) < m)).
    - induction j as [|j IH]; intros Hj; [apply filter_forall; intros; lia|]. specialize (IH ltac:(lia)).
      assert (C : continuous (fun u => Y u j) t) by (pose proof HM as [[_ C] _]; apply C; [unfold T in Ht; lra|lia]).
      pose proof (proj1 (filterlim_locally _ _) C (mkposreal m Hm)) as B. generalize (filter_and _ _ IH B). apply filter_imp.
      intros u [H1 H2] i Hi. destruct (Nat.eq_dec i j) as [->|]; [exact H2|apply H1; lia].
    - apply G. lia. }
  revert L. apply filter_imp. intros u Hu. change (Rabs (U (Y u) - U (Y t)) < e).
  assert (A : U (Y u) <= U (Y t) + K * m) by (apply U_near; [lra|]; intros i Hi; specialize (Hu i Hi); lra).
  assert (B : U (Y t) <= U (Y u) + K * m).
  { apply U_near; [lra|]. intros i Hi. specialize (Hu i Hi). rewrite Rabs_minus_sym. lra. }
  apply Rabs_def1; lra.
Qed.
Lemma positive : 0 < T /\ 0 < Q2R (rho1 c) /\ 0 < k c.
Proof.
  destruct above as [A _]. fold T in A. pose proof Hprot as H. unfold check_protocol in H. apply andb_prop in H as [H _]. apply andb_prop in H as [H H3].
  apply andb_prop in H as [H1 H2]. split; [lra|]. split; [apply Qpos; exact H1|]. apply Rmult_lt_0_compat; apply Qpos; assumption.
Qed.
Lemma clock_grows a t : 0 <= a <= t -> t < T -> clock T (Q2R (rho1 c)) (k c) a <= clock T (Q2R (rho1 c)) (k c) t.
Proof.
  intros Ha Ht. destruct positive as [P1 [P2 P3]]. apply Ropp_le_cancel.
  apply (decreasing T a (fun t => - clock T (Q2R (rho1 c)) (k c) t) (fun t => - gain t)); [| | |lra]; intros u Hu.
  - apply @is_derive_opp. apply clock_derive; [exact P1|apply Hu].
  - apply @ex_derive_continuous. eexists. apply @is_derive_opp. apply clock_derive; [exact P1|apply Hu].
  - assert (0 < gain u) by (apply gain_pos; lra). lra.
Qed.
(** soon after an instant *)
Lemma soon_after t e : 0 < t < Tr -> 0 < e -> 0 < U (X t) -> exists eta, 0 < eta /\ forall h, 0 < h < eta ->
  U (X (t + h)) <= U (X t) + h * (- (gain t * (r / 2 * U (X t))) + p t * w t * ww + f + e).
Proof.
  intros Ht He HU. destruct above as [A [M _]]. fold Tr T in A. destruct positive as [P1 [P2 P3]].
  assert (G : 0 < gain t) by (apply gain_pos; lra).
  assert (Hpush : 0 < push) by (pose proof (delta_pos c T_r T_s mu1 mu2 mu3 delta Hprot Hkind); unfold push; lra).
  destruct (U_falls (X t) HU) as [C [a [C0 [A0 F]]]].
  set (e1 := e / 4 * push / (f + 1)). assert (E1 : 0 < e1) by (unfold e1; apply Rdiv_lt_0_compat; [apply Rmult_lt_0_compat|]; lra).
  set (e2 := e / 4 / (K + 1)). assert (E2 : 0 < e2) by (unfold e2; apply Rdiv_lt_0_compat; lra).
  destruct (soon_all n (fun h i => exists a b, 0 <= a <= h * (p t * w t) /\ 0 <= b <= h * (push + e1) /\
    S (t + h) i - S t i = - (a * S 0 i) - b * sign (S 0 i)) (fun i Hi => loses i t e1 Hi ltac:(lra) E1)) as [n1 [N1 H1]].
  destruct (soon_all n (fun h i => Rabs (X (t + h) i - S (t + h) i - (X t i - S t i) - h * - (gain t * lap es (X t) i)) <= h * e2)) as [n2 [N2 H2]].
  { intros i Hi. pose proof HM as [[D _] _]. specialize (D t i ltac:(unfold T in *; lra) Hi). exact (derive_near _ _ _ _ D E2). }
  set (e3 := e / 4 / (C * (gain t * gain t) + 1)).
  assert (CG : 0 <= C * (gain t * gain t)) by (apply Rmult_le_pos; [exact C0|]; apply Rmult_le_pos; lra).
  assert (E3 : 0 < e3) by (unfold e3; apply Rdiv_lt_0_compat; lra).
  exists (Rmin (Rmin n1 n2) (Rmin (a / gain t) e3)). split.
  { repeat apply Rmin_pos; try assumption. apply Rdiv_lt_0_compat; assumption. }
  intros h Hh. pose proof (Rmin_l (Rmin n1 n2) (Rmin (a / gain t) e3)). pose proof (Rmin_r (Rmin n1 n2) (Rmin (a / gain t) e3)).
  pose proof (Rmin_l n1 n2). pose proof (Rmin_r n1 n2). pose proof (Rmin_l (a / gain t) e3). pose proof (Rmin_r (a / gain t) e3).
  specialize (H1 h ltac:(lra)). specialize (H2 h ltac:(lra)).
  assert (Ya : 0 <= h * gain t <= a).
  { split; [apply Rmult_le_pos; lra|]. apply (Rmult_le_reg_r (/ gain t)); [apply Rinv_0_lt_compat; exact G|].
    rewrite Rmult_assoc, Rinv_r by lra. unfold Rdiv in *. lra. }
  specialize (F (h * gain t) Ya).
  (* the parts *)
  assert (HC : forall i, exists ab : R * R, (i < n)%nat -> 0 <= fst ab <= h * (p t * w t) /\ 0 <= snd ab <= h * (push + e1) /\
    S (t + h) i - S t i = - (fst ab * S 0 i) - snd ab * sign (S 0 i)).
  { intros i. destruct (lt_dec i n) as [Hi|N]; [|exists (0, 0); intros; contradiction].
    destruct (H1 i Hi) as [x [y Q]]. exists (x, y). intros _. exact Q. }
  assert (HS : exists d1 d2 : nat -> R, (forall i, (i < n)%nat -> exists a, 0 <= a <= h * (p t * w t) /\ d1 i = - (a * S 0 i)) /\
    (forall i, (i < n)%nat -> exists b, 0 <= b <= h * (1 + e1 / push) * push /\ d2 i = - (b * sign (S 0 i))) /\
    forall i, (i < n)%nat -> S (t + h) i - S t i = d1 i + d2 i).
  { clear - H1 HC Hpush. assert (G : forall j, exists d1 d2 : nat -> R, forall i, (i < j)%nat -> (i < n)%nat ->
      (exists a, 0 <= a <= h * (p t * w t) /\ d1 i = - (a * S 0 i)) /\
      (exists b, 0 <= b <= h * (1 + e1 / push) * push /\ d2 i = - (b * sign (S 0 i))) /\ S (t + h) i - S t i = d1 i + d2 i).
    { induction j as [|j [d1 [d2 IH]]]; [exists (fun _ => 0), (fun _ => 0); intros; lia|].
      destruct (HC j) as [[x y] Q]. simpl in Q.
      exists (fun i => if Nat.eq_dec i j then - (x * S 0 j) else d1 i), (fun i => if Nat.eq_dec i j then - (y * sign (S 0 j)) else d2 i).
      intros i Hi Hn. destruct (Nat.eq_dec i j) as [->|]; [|apply IH; lia]. destruct (Q Hn) as [Q1 [Q2 Q3]].
      split; [exists x; split; [exact Q1|reflexivity]|]. split; [exists y; split; [|reflexivity]|rewrite Q3; ring].
      replace (h * (1 + e1 / push) * push) with (h * (push + e1)) by (field; lra). exact Q2. }
    destruct (G n) as [d1 [d2 Q]]. exists d1, d2. split; [|split]; intros i Hi; apply (Q i Hi Hi). }
  destruct HS as [d1 [d2 [D1 [D2 D3]]]].
  pose proof (pull_pos c T_r T_s mu1 mu2 mu3 delta Hprot Hkind t) as Pp. fold p in Pp. pose proof (w_pos t) as Pw.
  assert (Q1 : U d1 <= h * (p t * w t) * ww).
  { apply U_share; [|exact D1]. apply Rmult_le_pos; [lra|]. apply Rmult_le_pos; lra. }
  assert (Q2 : U d2 <= h * (1 + e1 / push) * f).
  { apply U_sign; [|exact D2]. apply Rmult_le_pos; [lra|]. assert (0 < e1 / push) by (apply Rdiv_lt_0_compat; lra). lra. }
  set (z := fun i => X t i - h * gain t * lap es (X t) i) in *.
  assert (Q3 : U (X (t + h)) <= U (fun i => z i + (d1 i + d2 i)) + K * (h * e2)).
  { apply U_near; [apply Rmult_le_pos; lra|]. intros i Hi. specialize (H2 i Hi). specialize (D3 i Hi). unfold z.
    eapply Rle_trans; [|exact H2]. right. f_equal. lra. }
  pose proof (U_plus z (fun i => d1 i + d2 i)) as Q4. pose proof (U_plus d1 d2) as Q5. cbv beta in Q4, Q5.
  eapply Rle_trans; [exact Q3|].
  assert (R1 : h * (1 + e1 / push) * f <= h * f + h * (e / 4)).
  { unfold e1. replace (h * (1 + e / 4 * push / (f + 1) / push) * f) with (h * f + h * (e / 4) * (f / (f + 1))) by (field; lra).
    apply Rplus_le_compat_l. rewrite <- (Rmult_1_r (h * (e / 4))) at 2. apply Rmult_le_compat_l; [apply Rmult_le_pos; lra|].
    apply (Rmult_le_reg_r (f + 1)); [lra|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l; lra. }
  assert (R2 : K * (h * e2) <= h * (e / 4)).
  { unfold e2. replace (K * (h * (e / 4 / (K + 1)))) with (h * (e / 4) * (K / (K + 1))) by (field; lra).
    rewrite <- (Rmult_1_r (h * (e / 4))) at 2. apply Rmult_le_compat_l; [apply Rmult_le_pos; lra|].
    apply (Rmult_le_reg_r (K + 1)); [lra|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l; lra. }
  assert (R3 : C * (h * gain t * (h * gain t)) <= h * (e / 4)).
  { replace (C * (h * gain t * (h * gain t))) with (h * (C * (gain t * gain t) * h)) by ring. apply Rmult_le_compat_l; [lra|].
    set (q := C * (gain t * gain t)) in *. apply Rle_trans with (q * e3); [apply Rmult_le_compat_l; lra|].
    assert (E : (q + 1) * e3 = e / 4) by (unfold e3; field; lra). lra. }
  pose proof (Rle_trans _ _ _ Q2 R1) as Q6.
  replace (h * gain t * (r / 2 * U (X t))) with (h * (gain t * (r / 2 * U (X t)))) in F by ring.
  replace (h * (- (gain t * (r / 2 * U (X t))) + p t * w t * ww + f + e))
    with (- (h * (gain t * (r / 2 * U (X t)))) + h * (p t * w t) * ww + h * f + h * (e / 4) + h * (e / 4) + h * (e / 4) + h * (e / 4)) by field.
  assert (H4' : 0 <= h * (e / 4)) by (apply Rmult_le_pos; [apply Rlt_le; apply Hh|clear - He; lra]).
  clear - F Q1 Q4 Q5 Q6 R2 R3 H4'.
  assert (G1 : U z + U (fun i => d1 i + d2 i) + K * (h * e2) <= U z + (U d1 + U d2) + h * (e / 4)) by (clear - Q5 R2; lra). lra.
Qed.
(** a piece before [T_r] *)
Let s := s c.
Theorem driven_before a t : 0 <= a <= t -> t < Tr ->
  U (X t) <= exp (- (r / 2 * (s t - s a))) * U (X a) + ww * (w a - w t) + f * (t - a).
Proof.
  intros Ha Ht. destruct above as [A _]. fold Tr T in A. destruct positive as [P1 [P2 P3]]. apply le_epsilon. intros e He.
  set (e0 := e / (1 + T)). assert (E0 : 0 < e0) by (unfold e0; apply Rdiv_lt_0_compat; lra).
  pose proof (U_pos (X a)) as Ua.
  set (E := fun u => exp (- (r / 2 * (s u - s a))) * (U (X a) + e0)).
  set (B := fun u => E u + ww * (w a - w u) + f * (u - a) + e0 * (u - a)).
  set (dB := fun u => - (gain u * (r / 2 * E u)) + ww * (p u * w u) + f + e0).
  assert (Ep : forall u, 0 < E u) by (intros u; unfold E; apply Rmult_lt_0_compat; [apply exp_pos|lra]).
  assert (D : forall u, u < Tr -> is_derive B u (dB u)).
  { intros u Hu. unfold B, dB. apply @is_derive_plus; [apply @is_derive_plus; [apply @is_derive_plus|]|].
    - unfold E. evar_last.
      + apply (is_derive_times (fun u => exp (- (r / 2 * (s u - s a)))) (fun _ => U (X a) + e0)); [|apply @is_derive_const].
        apply (is_derive_after exp (fun u => - (r / 2 * (s u - s a)))); [apply is_derive_exp|].
        apply @is_derive_opp. apply is_derive_scal. apply @is_derive_minus; [apply clock_derive; [exact P1|unfold T in *; lra]|apply @is_derive_const].
      + unfold minus, plus, opp, zero; simpl. change (Certificate.gain (deadline c) (Q2R (rho1 c)) (k c) u) with (gain u). field.
    - evar_last; [apply is_derive_scal; apply @is_derive_minus; [apply @is_derive_const|apply w_derive; exact Hu]|].
      unfold minus, plus, opp, zero; simpl. ring.
    - evar_last; [apply is_derive_scal; apply @is_derive_minus; [apply @is_derive_id|apply @is_derive_const]|].
      unfold minus, plus, opp, zero, one; simpl. ring.
    - evar_last; [apply is_derive_scal; apply @is_derive_minus; [apply @is_derive_id|apply @is_derive_const]|].
      unfold minus, plus, opp, zero, one; simpl. ring. }
  assert (WD : forall u, a <= u -> u < Tr -> w u <= w a) by (intros u Hu1 Hu2; apply (psi_falls c T_r T_s mu1 mu2 mu3 delta Hprot Hkind); assumption).
  assert (L : 0 <= B t - U (Y t)).
  { apply (stays a t (fun u => B u - U (Y u))); [lra| | |].
    - intros u Hu. apply (continuous_minus B (fun u => U (Y u))); [|apply U_cont; lra].
      apply @ex_derive_continuous. exists (dB u). apply D. lra.
    - unfold B, E, Y. rewrite Rmax_right by lra. replace (s a - s a) with 0 by ring. rewrite Rmult_0_r, Ropp_0, exp_0. lra.
    - intros u Hu Z. unfold Y in Z. rewrite Rmax_right in Z by lra.
      assert (EB : E u <= B u).
      { unfold B. specialize (WD u ltac:(lra) ltac:(lra)). assert (0 <= ww * (w a - w u)) by (apply Rmult_le_pos; lra).
        assert (0 <= f * (u - a)) by (apply Rmult_le_pos; lra). assert (0 <= e0 * (u - a)) by (apply Rmult_le_pos; lra). lra. }
      assert (Uu : 0 < U (X u)) by (specialize (Ep u); lra).
      assert (Na : a < u).
      { destruct (Rle_lt_or_eq_dec a u ltac:(lra)) as [|Q]; [assumption|]. exfalso. subst u. unfold B, E in Z.
        replace (s a - s a) with 0 in Z by ring. rewrite Rmult_0_r, Ropp_0, exp_0 in Z. lra. }
      destruct (soon_after u (e0 / 2) ltac:(lra) ltac:(lra) Uu) as [n1 [N1 H1]].
      destruct (derive_near B u (dB u) (e0 / 2) (D u ltac:(lra)) ltac:(lra)) as [n2 [N2 H2]].
      exists (Rmin n1 n2). split; [apply Rmin_pos; assumption|]. intros h Hh. pose proof (Rmin_l n1 n2). pose proof (Rmin_r n1 n2).
      specialize (H1 h ltac:(lra)). specialize (H2 h ltac:(lra)). apply Rabs_le_between in H2.
      unfold Y. rewrite Rmax_right by lra. assert (G : 0 < gain u) by (apply gain_pos; lra).
      assert (Q : h * (gain u * (r / 2 * E u)) <= h * (gain u * (r / 2 * U (X u)))).
      { apply Rmult_le_compat_l; [lra|]. apply Rmult_le_compat_l; [lra|]. apply Rmult_le_compat_l; lra. }
      unfold dB in H2. lra. }
  unfold Y in L. rewrite Rmax_right in L by lra. unfold B, E in L.
  assert (X1 : exp (- (r / 2 * (s t - s a))) <= 1).
  { rewrite <- exp_0. assert (Q : s a <= s t).
    { apply clock_grows; lra. }
    assert (0 <= r / 2 * (s t - s a)) by (apply Rmult_le_pos; lra).
    destruct (Req_dec (r / 2 * (s t - s a)) 0) as [->|N]; [rewrite Ropp_0; lra|]. left. apply exp_increasing. lra. }
  assert (X2 : exp (- (r / 2 * (s t - s a))) * e0 <= e0) by (rewrite <- (Rmult_1_l e0) at 2; apply Rmult_le_compat_r; lra).
  assert (X3 : e0 * (t - a) <= e0 * T) by (apply Rmult_le_compat_l; lra).
  assert (X4 : e0 * (1 + T) = e) by (unfold e0; field; lra). lra.
Qed.
Let left_of := left_of c T_r mu2 mu3.
Hypothesis U_rest : forall t0 t, moves_from c X S t0 -> t0 <= t < T -> U (X t) <= exp (- (r / 2 * (s t - s t0))) * U (X t0).
Theorem driven_on a t : 0 <= a <= t -> t < T ->
  U (X t) <= exp (- (r / 2 * (s t - s a))) * U (X a) + ww * (left_of a - left_of t) + f * (t - a).
Proof.
  intros Ha Ht. destruct above as [A _]. fold Tr T in A. destruct positive as [P1 [P2 P3]].
  destruct (Rlt_dec t Tr) as [L|L].
  { unfold left_of, Driven.left_of. fold Tr w. destruct (Rlt_dec a Tr); [|lra]. destruct (Rlt_dec t Tr); [|lra]. apply driven_before; lra. }
  assert (Q : forall u, Tr <= u < T -> moves_from c X S u).
  { intros u Hu. split; [exact HM|]. split; [unfold T in *; lra|]. intros v i Hv Hi.
    apply (rests c T_r T_s mu1 mu2 mu3 delta Hprot Hkind X S i HM Hi). fold Tr. lra. }
  unfold left_of at 2, Driven.left_of. fold Tr w. destruct (Rlt_dec t Tr); [lra|]. rewrite Rminus_0_r. destruct (Rlt_dec a Tr) as [La|La].
  - unfold left_of, Driven.left_of. fold Tr w. destruct (Rlt_dec a Tr); [|lra].
    set (R0 := fun u => exp (- (r / 2 * (s u - s a))) * U (X a) + ww * w a + f * (u - a)).
    assert (CR : forall u, u < T -> continuous R0 u).
    { intros u Hu. apply @ex_derive_continuous. unfold R0. eexists. apply @is_derive_plus; [apply @is_derive_plus|].
      - apply (is_derive_times (fun u => exp (- (r / 2 * (s u - s a)))) (fun _ => U (X a))); [|apply @is_derive_const].
        apply (is_derive_after exp (fun u => - (r / 2 * (s u - s a)))); [apply is_derive_exp|].
        apply @is_derive_opp. apply is_derive_scal. apply @is_derive_minus; [apply clock_derive; [exact P1|exact Hu]|apply @is_derive_const].
      - apply @is_derive_const.
      - apply is_derive_scal. apply @is_derive_minus; [apply @is_derive_id|apply @is_derive_const]. }
    assert (before : forall u, a <= u < Tr -> 0 <= R0 u - U (Y u)).
    { intros u Hu. pose proof (driven_before a u ltac:(lra) ltac:(lra)) as B. unfold Y, R0. rewrite Rmax_right by lra.
      assert (0 <= ww * w u) by (apply Rmult_le_pos; [exact Hww|left; apply w_pos]). lra. }
    assert (M : 0 <= R0 Tr - U (Y Tr)).
    { apply (stays a Tr (fun u => R0 u - U (Y u))); [lra| | |].
      - intros u Hu. apply (continuous_minus R0 (fun u => U (Y u))); [apply CR; lra|apply U_cont; lra].
      - apply before. lra.
      - intros u Hu _. exists (Tr - u). split; [lra|]. intros h Hh. apply before. lra. }
    unfold Y in M. rewrite Rmax_right in M by lra. pose proof (U_rest Tr t (Q Tr ltac:(lra)) ltac:(lra)) as D.
    eapply Rle_trans; [exact D|]. set (x := exp (- (r / 2 * (s t - s Tr)))) in *.
    assert (X0 : 0 < x) by apply exp_pos.
    assert (X1 : x <= 1).
    { unfold x. rewrite <- exp_0. assert (Z : s Tr <= s t).
      { apply clock_grows; lra. }
      assert (0 <= r / 2 * (s t - s Tr)) by (apply Rmult_le_pos; lra).
      destruct (Req_dec (r / 2 * (s t - s Tr)) 0) as [->|N]; [rewrite Ropp_0; lra|]. left. apply exp_increasing. lra. }
    apply Rle_trans with (x * R0 Tr); [apply Rmult_le_compat_l; lra|]. unfold R0.
    replace (exp (- (r / 2 * (s t - s a)))) with (x * exp (- (r / 2 * (s Tr - s a)))) by (unfold x; rewrite <- exp_plus; f_equal; ring).
    pose proof (w_pos a). assert (0 <= ww * w a) by (apply Rmult_le_pos; lra). assert (0 <= f * (Tr - a)) by (apply Rmult_le_pos; lra).
    assert (f * (Tr - a) <= f * (t - a)) by (apply Rmult_le_compat_l; lra). nra.
  - unfold left_of, Driven.left_of. fold Tr w. destruct (Rlt_dec a Tr); [lra|]. pose proof (U_rest a t (Q a ltac:(lra)) ltac:(lra)).
    assert (0 <= f * (t - a)) by (apply Rmult_le_pos; lra). lra.
Qed.
End Driven.
