(** While sliding variables move: what neither the largest state nor the largest [|(L x)_i|] ever exceeds. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Certificate Checker Flow Sound Slide Solution Exist Input Mean Effort Peak Reach Driven Moving Measure.
Open Scope R_scope.

Definition largest_size n (x : nat -> R) : R := fold_right (fun i a => Rmax (Rabs (x i)) a) 0 (seq 0 n).
Lemma largest_pos n x : 0 <= largest_size n x.
Proof. unfold largest_size. induction (seq 0 n) as [|i l IH]; simpl; [lra|]. eapply Rle_trans; [exact IH|apply Rmax_r]. Qed.
Lemma largest_above n x i : (i < n)%nat -> Rabs (x i) <= largest_size n x.
Proof.
  intros Hi. assert (I : In i (seq 0 n)) by (apply in_seq; lia). unfold largest_size. induction (seq 0 n) as [|j l IH]; simpl; [destruct I|].
  destruct I as [->|I]; [apply Rmax_l|]. eapply Rle_trans; [apply IH; exact I|apply Rmax_r].
Qed.
Lemma largest_below n x M : 0 <= M -> (forall i, (i < n)%nat -> Rabs (x i) <= M) -> largest_size n x <= M.
Proof.
  intros HM H. assert (K : forall i, In i (seq 0 n) -> Rabs (x i) <= M) by (intros i Hi; apply in_seq in Hi; apply H; lia).
  unfold largest_size. induction (seq 0 n) as [|j l IH]; simpl; [exact HM|]. apply Rmax_lub; [apply K; left; reflexivity|].
  apply IH. intros i Hi. apply K. right. exact Hi.
Qed.
(** a short step along [- L x] does not grow it *)
Lemma step_inside es n : (forall e, In e es -> (src e < n)%nat) -> exists a, 0 < a /\ forall x y M, 0 <= y <= a -> 0 <= M ->
  (forall i, (i < n)%nat -> Rabs (x i) <= M) -> forall i, (i < n)%nat -> Rabs (x i - y * lap es x i) <= M.
Proof.
  intros Hs. set (W := fold_right (fun e a => Rabs (Q2R (wt e)) + a) 0 es).
  assert (W0 : 0 <= W) by (unfold W; clear; induction es as [|e l IH]; simpl; [lra|]; pose proof (Rabs_pos (Q2R (wt e))); lra).
  exists (/ (W + 1)). assert (P : 0 < / (W + 1)) by (apply Rinv_0_lt_compat; lra). split; [exact P|]. intros x y M Hy HM H i Hi.
  assert (YW : y * W <= 1).
  { apply Rle_trans with (/ (W + 1) * (W + 1)); [apply Rmult_le_compat; lra|]. rewrite Rinv_l; lra. }
  assert (K : exists D q, 0 <= D <= W /\ Rabs q <= D * M /\ lap es x i = D * x i - q).
  { unfold W, lap. clear - Hs HM H Hi. induction es as [|e l IH]; simpl; [exists 0, 0; rewrite Rabs_R0; lra|].
    destruct IH as [D [q [HD [Hq E]]]]; [intros; apply Hs; right; assumption|]. rewrite E. unfold lap_edge.
    pose proof (Rabs_pos (Q2R (wt e))) as A. destruct (tgt e =? i)%nat.
    - exists (Rabs (Q2R (wt e)) + D), (Q2R (wt e) * x (src e) + q). split; [lra|]. split; [|ring].
      eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_mult, Rmult_plus_distr_r. apply Rplus_le_compat; [|exact Hq].
      apply Rmult_le_compat_l; [exact A|]. apply H. apply Hs. left. reflexivity.
    - exists D, q. split; [lra|]. split; [exact Hq|ring]. }
  destruct K as [D [q [HD [Hq E]]]]. rewrite E. replace (x i - y * (D * x i - q)) with ((1 - y * D) * x i + y * q) by ring.
  eapply Rle_trans; [apply Rabs_triang|]. rewrite !Rabs_mult. specialize (H i Hi).
  assert (YD : 0 <= y * D <= 1) by (split; [apply Rmult_le_pos; lra|]; assert (y * D <= y * W) by (apply Rmult_le_compat_l; lra); lra).
  rewrite (Rabs_right (1 - y * D)), (Rabs_right y) by lra.
  assert ((1 - y * D) * Rabs (x i) <= (1 - y * D) * M) by (apply Rmult_le_compat_l; lra).
  assert (y * Rabs q <= y * (D * M)) by (apply Rmult_le_compat_l; lra). lra.
Qed.

Lemma lap_size es n : (forall e, In e es -> (src e < n)%nat) -> exists K, 0 <= K /\ forall x M, 0 <= M ->
  (forall i, (i < n)%nat -> Rabs (x i) <= M) -> forall i, (i < n)%nat -> Rabs (lap es x i) <= K * M.
Proof.
  intros Hs. destruct (step_inside es n Hs) as [a [Ha H]]. exists (2 / a). split; [left; apply Rdiv_lt_0_compat; lra|]. intros x M HM Hx i Hi.
  pose proof (H x a M ltac:(lra) HM Hx i Hi) as A. specialize (Hx i Hi). apply (Rmult_le_reg_l a); [exact Ha|].
  replace (a * (2 / a * M)) with (M + M) by (field; lra). rewrite <- (Rabs_right a) at 1 by lra. rewrite <- Rabs_mult.
  replace (a * lap es x i) with (x i - (x i - a * lap es x i)) by ring. unfold Rminus at 1. eapply Rle_trans; [apply Rabs_triang|].
  rewrite Rabs_Ropp. lra.
Qed.

Lemma sign_ok q : sign (Q2R q) = IZR (Z.sgn (Qnum q)).
Proof.
  unfold sign. assert (P : 0 < / IZR (Zpos (Qden q))) by (apply Rinv_0_lt_compat, IZR_lt; reflexivity).
  destruct q as [[|a|a] b]; unfold Q2R; cbn [Qnum Qden Z.sgn] in *.
  - rewrite Rmult_0_l. destruct (Rlt_dec 0 0); [lra|reflexivity].
  - destruct (Rlt_dec 0 _) as [_|N]; [reflexivity|]. exfalso. apply N. apply Rmult_lt_0_compat; [apply IZR_lt; reflexivity|exact P].
  - assert (K : IZR (Zneg a) * / IZR (Zpos b) < 0).
    { assert (IZR (Zneg a) < 0) by (apply IZR_lt; reflexivity). nra. }
    destruct (Rlt_dec 0 _) as [L|_]; [lra|]. destruct (Rlt_dec _ 0) as [_|N]; [reflexivity|contradiction].
Qed.

(** what holds from the instant on from which no sliding variable moves *)
Section Rests.
Variables (c : cert) (X S : R -> nat -> R) (t0 : R).
Let n := order c.
Let es := edges c.
Let T := deadline c.
Hypotheses (HT : 0 < T) (H1 : 0 < Q2R (rho1 c)) (Hk : 0 < k c).
Hypothesis Hsrc : forall e, In e es -> (src e < n)%nat.
Hypothesis HX : moves_from c X S t0.
Let Y (u : R) : nat -> R := X (Rmax t0 u).
Let f (u : R) : nat -> R := Y (t0 + u).
Lemma shifted : 0 <= t0 < T /\ (forall u i, 0 < u < T - t0 -> (i < n)%nat ->
    is_derive (fun u => f u i) u (- (gain (T - t0) (Q2R (rho1 c)) (k c) u * lap es (f u) i))) /\
  forall u i, 0 <= u < T - t0 -> (i < n)%nat -> continuous (fun u => f u i) u.
Proof.
  pose proof HX as [[HM _] HQ]. pose proof HQ as [Ht0 _]. fold T in Ht0. split; [exact Ht0|]. split; intros u i Hu Hi.
  - pose proof (Y_derive n (lap es) T _ _ X S t0 HM HQ (t0 + u) i ltac:(lra) Hi) as D. cbv beta in D.
    evar_last; [apply (is_derive_comp (fun v => Y v i) (fun u => t0 + u)); [exact D|]|].
    + apply @is_derive_plus; [apply @is_derive_const|apply @is_derive_id].
    + unfold scal, plus, zero, one; simpl; unfold mult; simpl. unfold gain, f, Y. replace (T - t0 - u) with (T - (t0 + u)) by ring. ring.
  - apply (continuous_comp (fun u => t0 + u) (fun v => Y v i)); [|apply (Y_cont n (lap es) T _ _ X S t0 HM HQ); [lra|exact Hi]].
    apply (continuous_plus (fun _ => t0) (fun u => u)); [apply continuous_const|apply continuous_id].
Qed.
Lemma never_above_begin (g : (nat -> R) -> nat -> R) M t i :
  (forall u j, 0 < u < T - t0 -> (j < n)%nat -> is_derive (fun u => g (f u) j) u (- (gain (T - t0) (Q2R (rho1 c)) (k c) u * lap es (g (f u)) j))) ->
  (forall u j, 0 <= u < T - t0 -> (j < n)%nat -> continuous (fun u => g (f u) j) u) -> 0 <= M ->
  (forall j, (j < n)%nat -> Rabs (g (X t0) j) <= M) -> t0 <= t < T -> (i < n)%nat -> Rabs (g (X t) i) <= M.
Proof.
  intros D C HM H Ht Hi. destruct shifted as [A _].
  pose proof (contained es n (T - t0) (Q2R (rho1 c)) (k c) ltac:(lra) H1 Hk Hsrc (fun u => g (f u)) D C M HM) as K.
  assert (E : forall u, 0 <= u -> f u = X (t0 + u)) by (intros u Hu; unfold f, Y; rewrite Rmax_right by lra; reflexivity).
  replace t with (t0 + (t - t0)) by ring. rewrite <- E by lra. apply K; [|lra|exact Hi].
  intros j Hj. rewrite E by lra. rewrite Rplus_0_r. apply H. exact Hj.
Qed.
Lemma states_stay M t i : 0 <= M -> (forall j, (j < n)%nat -> Rabs (X t0 j) <= M) -> t0 <= t < T -> (i < n)%nat -> Rabs (X t i) <= M.
Proof. destruct shifted as [_ [D C]]. exact (never_above_begin (fun x => x) M t i D C). Qed.
Lemma errors_stay M t i : 0 <= M -> (forall j, (j < n)%nat -> Rabs (lap es (X t0) j) <= M) -> t0 <= t < T -> (i < n)%nat ->
  Rabs (lap es (X t) i) <= M.
Proof.
  destruct shifted as [_ [D C]]. apply (never_above_begin (lap es)); intros u j Hu Hj.
  - rewrite <- lap_scal. apply (is_derive_lap es n f); auto.
  - apply (continuous_lap es n f); auto.
Qed.
End Rests.

Section Largest.
Variables (c : cert) (T_r T_s mu1 mu2 mu3 delta : Q).
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hkind : kind c = SlidingMode T_r T_s mu1 mu2 mu3 delta.
Let d := prepare c.
Let n := order c.
Let es := edges c.
Let T := deadline c.
Hypothesis Hls : good (dls d) (map wt es) = true.
Hypothesis Hfit : fits n (dL d) = true.
Hypothesis Hsrc : forall e, In e es -> (src e < n)%nat.
Hypothesis Gs : good (common (sliding c)) (sliding c) = true.
Hypothesis Gx : good (common (start c)) (start c) = true.
Variables (X S : R -> nat -> R).
Hypothesis HM : moves c X S.
Hypothesis X0 : forall i, (i < n)%nat -> X 0 i = Q2R (nth i (start c) 0%Q).
Hypothesis S0 : forall i, (i < n)%nat -> S 0 i = Q2R (nth i (sliding c) 0%Q).
Let push := (mu1 + delta)%Q.
Let push_eq : Q2R push = Q2R mu1 + Q2R delta := Q2R_plus mu1 delta.
Let positive3 := Driven.positive c T_r T_s mu1 mu2 mu3 delta Hprot Hkind.

(** of the state, or of the errors *)
Section Either.
Variable A : (nat -> R) -> nat -> R.
Variables (K ww f : R).
Hypotheses (K0 : 0 <= K) (W0 : 0 <= ww) (F0 : 0 <= f).
Hypothesis A_plus : forall x y i, A (fun j => x j + y j) i = A x i + A y i.
Hypothesis A_step : forall x y i, A (fun j => x j - y * lap es x j) i = A x i - y * lap es (A x) i.
Hypothesis A_size : forall x M, 0 <= M -> (forall i, (i < n)%nat -> Rabs (x i) <= M) -> forall i, (i < n)%nat -> Rabs (A x i) <= K * M.
Hypothesis A_share : forall M x, 0 <= M -> (forall i, (i < n)%nat -> exists a, 0 <= a <= M /\ x i = - (a * S 0 i)) ->
  forall i, (i < n)%nat -> Rabs (A x i) <= M * ww.
Hypothesis A_sign : forall M x, 0 <= M -> (forall i, (i < n)%nat -> exists b, 0 <= b <= M * (Q2R mu1 + Q2R delta) /\ x i = - (b * sign (S 0 i))) ->
  forall i, (i < n)%nat -> Rabs (A x i) <= M * f.
Hypothesis A_rest : forall t0 M t, moves_from c X S t0 -> 0 <= M -> (forall j, (j < n)%nat -> Rabs (A (X t0) j) <= M) -> t0 <= t < T ->
  forall i, (i < n)%nat -> Rabs (A (X t) i) <= M.
Let U x := largest_size n (A x).
Lemma never_beyond M t i : 0 <= M -> (forall j, (j < n)%nat -> Rabs (A (X 0) j) <= M) -> 0 <= t < T -> (i < n)%nat ->
  Rabs (A (X t) i) <= M + ww + f * Q2R T_r.
Proof.
  intros HM0 HI Ht Hi. destruct (parts c T_r T_s mu1 mu2 mu3 delta Hprot Hkind) as [HT _]. fold T in HT.
  destruct (step_inside es n Hsrc) as [a [Ha Hin]].
  assert (Rest : forall t0 u, moves_from c X S t0 -> t0 <= u < T -> U (X u) <= U (X t0)).
  { intros t0 u HQ Hu. apply largest_below; [apply largest_pos|]. intros j Hj.
    apply (A_rest t0 _ u HQ (largest_pos _ _)); [|exact Hu|exact Hj]. intros l Hl. apply largest_above. exact Hl. }
  assert (D : forall u, 0 <= u < T -> U (X u) <= U (X 0) + ww + f * u).
  { intros u Hu. pose proof (driven_on c T_r T_s mu1 mu2 mu3 delta Hprot Hkind X S HM U 0 K ww f (Rle_refl 0) K0 W0 F0) as Q.
    assert (E : forall v, exp (- (0 / 2 * v)) = 1) by (intros v; replace (- (0 / 2 * v)) with 0 by field; apply exp_0).
    specialize (Q (fun x => largest_pos n (A x))). cbv beta in Q.
    assert (Q1 : forall x y, U (fun i => x i + y i) <= U x + U y).
    { intros x y. apply largest_below; [apply Rplus_le_le_0_compat; apply largest_pos|]. intros j Hj. rewrite A_plus.
      eapply Rle_trans; [apply Rabs_triang|]. apply Rplus_le_compat; apply largest_above; exact Hj. }
    specialize (Q Q1). assert (Q2 : forall x M, 0 <= M -> (forall i, (i < order c)%nat -> Rabs (x i) <= M) -> U x <= K * M).
    { intros x M' HM' Hx. apply largest_below; [apply Rmult_le_pos; assumption|]. apply A_size; assumption. }
    specialize (Q Q2). assert (Q3 : forall x, 0 < U x -> exists C a, 0 <= C /\ 0 < a /\ forall y, 0 <= y <= a ->
      U (fun i => x i - y * lap (edges c) x i) <= U x - y * (0 / 2 * U x) + C * (y * y)).
    { intros x _. exists 0, a. split; [lra|]. split; [exact Ha|]. intros y Hy. replace (U x - y * (0 / 2 * U x) + 0 * (y * y)) with (U x) by field.
      apply largest_below; [apply largest_pos|]. intros j Hj. rewrite A_step.
      apply (Hin (A x) y (U x) Hy (largest_pos _ _)); [|exact Hj]. intros l Hl. apply largest_above. exact Hl. }
    specialize (Q Q3). assert (Q4 : forall M x, 0 <= M -> (forall i, (i < order c)%nat -> exists a, 0 <= a <= M /\ x i = - (a * S 0 i)) -> U x <= M * ww).
    { intros M' x HM' Hx. apply largest_below; [apply Rmult_le_pos; assumption|]. apply A_share; assumption. }
    specialize (Q Q4). assert (Q5 : forall M x, 0 <= M -> (forall i, (i < order c)%nat -> exists b, 0 <= b <= M * (Q2R mu1 + Q2R delta) /\
      x i = - (b * sign (S 0 i))) -> U x <= M * f).
    { intros M' x HM' Hx. apply largest_below; [apply Rmult_le_pos; assumption|]. apply A_sign; assumption. }
    specialize (Q Q5). assert (Q6 : forall t0 t, moves_from c X S t0 -> t0 <= t < deadline c -> U (X t) <= exp (- (0 / 2 * (s c t - s c t0))) * U (X t0)).
    { intros t0 v HQ Hv. rewrite E, Rmult_1_l. apply Rest; assumption. }
    specialize (Q Q6 0 u ltac:(lra) (proj2 Hu)). rewrite E, Rmult_1_l, Rminus_0_r in Q.
    assert (L0 : left_of c T_r mu2 mu3 0 = 1).
    { unfold left_of. destruct (Rlt_dec 0 (Q2R T_r)); [|lra]. apply (psi_0 c T_r T_s mu1 mu2 mu3 delta Hprot Hkind). }
    assert (L1 : 0 <= left_of c T_r mu2 mu3 u).
    { unfold left_of. destruct (Rlt_dec u (Q2R T_r)); [left; apply psi_pos|lra]. }
    rewrite L0 in Q. assert (ww * (1 - left_of c T_r mu2 mu3 u) <= ww * 1) by (apply Rmult_le_compat_l; lra). lra. }
  eapply Rle_trans; [apply (largest_above n (A (X t)) i Hi)|]. fold (U (X t)).
  assert (I0 : U (X 0) <= M) by (apply largest_below; assumption). destruct (Rle_lt_dec t (Q2R T_r)) as [L|L].
  - specialize (D t Ht). assert (f * t <= f * Q2R T_r) by (apply Rmult_le_compat_l; lra). lra.
  - assert (HQ : moves_from c X S (Q2R T_r)).
    { split; [exact HM|]. split; [unfold T in HT; lra|]. intros u j Hu Hj. apply (rests c T_r T_s mu1 mu2 mu3 delta Hprot Hkind X S j HM Hj). lra. }
    pose proof (Rest (Q2R T_r) t HQ ltac:(lra)). specialize (D (Q2R T_r) ltac:(lra)). lra.
Qed.
End Either.

Lemma dL_row x i : (i < n)%nat -> dot (nth i (dL d) []) x = IZR (dls d) * lap es x i.
Proof. intros Hi. change (dL d) with (lmat (dls d) es n). unfold lmat. rewrite nth_map_seq by exact Hi. apply lrow_ok. exact Hls. Qed.
Lemma dL_len i : (i < n)%nat -> (length (nth i (dL d) []) <= n)%nat.
Proof.
  intros Hi. destruct (fits_ok _ _ Hfit) as [_ F2]. unfold rows_le in F2. rewrite Forall_forall in F2. apply F2. apply nth_In.
  unfold d. rewrite len_dL. exact Hi.
Qed.
(** the largest over rows *)
Lemma over_rows (g : vec -> Z) u i : (0 < u)%Z -> (i < n)%nat ->
  Rabs (IZR (g (nth i (dL d) [])) / (IZR (dls d) * IZR u)) <= Q2R (greatest (map (fun r => (inject_Z (g r) / inject_Z (dls d * u))%Q) (dL d))).
Proof.
  intros Hu Hi. destruct (good_ok _ _ Hls) as [Hl _]. eapply Rle_trans; [|apply (greatest_ok _ i)]. apply Req_le. f_equal.
  rewrite nth_indep with (d' := (fun r => (inject_Z (g r) / inject_Z (dls d * u))%Q) []) by (rewrite map_length; unfold d; rewrite len_dL; exact Hi).
  rewrite (map_nth (fun r => (inject_Z (g r) / inject_Z (dls d * u))%Q)).
  rewrite Q2R_div, !Q2R_inject, mult_IZR by (unfold Qeq; cbn [Qnum Qden inject_Z]; nia). reflexivity.
Qed.
Lemma lap_driven C M x i : 0 <= M -> (forall j, (j < n)%nat -> exists a, 0 <= a <= M /\ x j = - (a * IZR (nth j C 0%Z))) -> (i < n)%nat ->
  Rabs (lap es x i) <= M * Rabs (IZR (sided C (nth i (dL d) [])) / IZR (dls d)).
Proof.
  intros HM0 H Hi. destruct (good_ok _ _ Hls) as [Hl _]. apply IZR_lt in Hl.
  pose proof (sided_ok M HM0 (nth i (dL d) []) C x (fun j Hj => H j (Nat.lt_le_trans _ _ _ Hj (dL_len i Hi)))) as B.
  rewrite dL_row, Rabs_mult, (Rabs_right (IZR (dls d))) in B by (exact Hi || lra).
  pose proof (Rle_abs (IZR (sided C (nth i (dL d) [])))) as L. unfold Rdiv. rewrite Rabs_mult, (Rabs_right (/ IZR (dls d))).
  2: { apply Rle_ge. left. apply Rinv_0_lt_compat. exact Hl. }
  apply (Rmult_le_reg_l (IZR (dls d))); [exact Hl|]. eapply Rle_trans; [exact B|].
  replace (IZR (dls d) * (M * (Rabs (IZR (sided C (nth i (dL d) []))) * / IZR (dls d)))) with (Rabs (IZR (sided C (nth i (dL d) []))) * M) by (field; lra).
  apply Rmult_le_compat_r; assumption.
Qed.
Lemma never_ok i t : (i < n)%nat -> 0 <= t < T -> Rabs (lap es (X t) i) <= Q2R (nth i (never_above c d push T_r) 0%Q).
Proof.
  intros Hi Ht. destruct positive3 as [P1 [P2 P3]]. destruct (good_ok _ _ Hls) as [Hl _]. destruct (good_ok _ _ Gs) as [Hs _].
  destruct (good_ok _ _ Gx) as [Hb _].
  assert (Hpush : 0 < Q2R push).
  { destruct (parts c T_r T_s mu1 mu2 mu3 delta Hprot Hkind) as [_ [B _]]. pose proof (delta_pos c T_r T_s mu1 mu2 mu3 delta Hprot Hkind). lra. }
  unfold never_above. cbv zeta. set (over := fun (f : vec -> Z) u => greatest (map (fun r => (inject_Z (f r) / inject_Z (dls d * u))%Q) (dL d))).
  assert (OP : forall g u, 0 <= Q2R (over g u)) by (intros g u; eapply Rle_trans; [apply Rabs_pos|apply (greatest_ok _ 0)]).
  set (b := common (start c)). set (sb := common (sliding c)) in *. set (C := map (scaled sb) (sliding c)).
  set (me := (over (fun r => zdot r (map (scaled b) (start c))) b + (over (sided C) sb + push * over (sided (start_signs c)) 1%Z * T_r))%Q).
  set (mx := (greatest (start c) + (greatest (sliding c) + push * T_r))%Q).
  assert (GP : forall l, 0 <= Q2R (greatest l)) by (intros l; eapply Rle_trans; [apply Rabs_pos|apply (greatest_ok _ 0)]).
  assert (B1 : Rabs (lap es (X t) i) <= Q2R me).
  { unfold me. rewrite !Q2R_plus, !Q2R_mult. rewrite <- Rplus_assoc. destruct (lap_size es n Hsrc) as [K [K0 HK]].
    apply (never_beyond (lap es) K (Q2R (over (sided C) sb)) (Q2R push * Q2R (over (sided (start_signs c)) 1%Z)) K0 (OP _ _)); auto.
    - apply Rmult_le_pos; [lra|apply OP].
    - intros x y j. apply lap_plus.
    - intros x y j. apply lap_linear.
    - intros M x HM0 H j Hj.
      assert (Hsb : 0 < IZR sb) by (apply IZR_lt; exact Hs).
      pose proof (lap_driven C (M / IZR sb) x j) as Q. eapply Rle_trans; [apply Q; [| |exact Hj]|].
      + apply Rmult_le_pos; [exact HM0|left; apply Rinv_0_lt_compat; exact Hsb].
      + intros l Hlt. destruct (H l Hlt) as [a [Ha Ex]]. exists (a / IZR sb). pose proof (Rinv_0_lt_compat _ Hsb) as I. unfold Rdiv.
        split; [split; [apply Rmult_le_pos; lra|apply Rmult_le_compat_r; lra]|].
        rewrite Ex, S0 by exact Hlt. unfold C. rewrite (nth_scaled sb (sliding c) l Gs). field. lra.
      + pose proof (over_rows (sided C) sb j Hs Hj) as R. unfold Rdiv in R |- *. rewrite Rabs_mult in R |- *.
        rewrite Rinv_mult in R. rewrite Rabs_mult in R. rewrite (Rabs_right (/ IZR sb)) in R.
        2: { apply Rle_ge. left. apply Rinv_0_lt_compat. exact Hsb. }
        unfold over. replace (M * / IZR sb * (Rabs (IZR (sided C (nth j (dL d) []))) * Rabs (/ IZR (dls d))))
          with (M * (Rabs (IZR (sided C (nth j (dL d) []))) * (Rabs (/ IZR (dls d)) * / IZR sb))) by ring.
        apply Rmult_le_compat_l; [exact HM0|exact R].
    - intros M x HM0 H j Hj. pose proof (lap_driven (start_signs c) (M * Q2R push) x j) as Q. eapply Rle_trans; [apply Q; [| |exact Hj]|].
      + apply Rmult_le_pos; lra.
      + intros l Hlt. destruct (H l Hlt) as [a [Ha Ex]]. exists a. split; [rewrite push_eq; exact Ha|].
        rewrite Ex, S0 by exact Hlt. f_equal. f_equal. unfold start_signs. change 0%Z with ((fun q => Z.sgn (Qnum q)) 0%Q). rewrite map_nth.
        apply sign_ok.
      + rewrite Rmult_assoc. apply Rmult_le_compat_l; [exact HM0|]. apply Rmult_le_compat_l; [lra|].
        pose proof (over_rows (sided (start_signs c)) 1 j eq_refl Hj) as R. rewrite Rmult_1_r in R. exact R.
    - intros t0 M u HQ HM0 H Hu j Hj. apply (errors_stay c X S t0 P2 P3 Hsrc HQ M u j HM0 H Hu Hj).
    - intros j Hj. pose proof (over_rows (fun r => zdot r (map (scaled b) (start c))) b j Hb Hj) as R.
      cbv beta in R. unfold d, b in R. rewrite (begin_ok c Hls Hsrc Gx (X 0) X0 j Hj) in R. apply IZR_lt in Hl, Hb.
      eapply Rle_trans; [|exact R]. apply Req_le. f_equal. fold d es. field. lra. }
  assert (B2 : Rabs (lap es (X t) i) <= Q2R (inject_Z (size (nth i (dL d) [])) / inject_Z (dls d) * mx)).
  { assert (M0 : 0 <= Q2R mx).
    { unfold mx. rewrite !Q2R_plus, Q2R_mult. destruct (parts c T_r T_s mu1 mu2 mu3 delta Hprot Hkind) as [HT _].
      pose proof (GP (start c)). pose proof (GP (sliding c)). assert (0 <= Q2R push * Q2R T_r) by (apply Rmult_le_pos; lra). lra. }
    assert (K : forall j, (j < n)%nat -> Rabs (X t j) <= Q2R mx).
    { intros j Hj. unfold mx. rewrite !Q2R_plus, Q2R_mult. rewrite <- Rplus_assoc.
      apply (never_beyond (fun x => x) 1 (Q2R (greatest (sliding c))) (Q2R push) Rle_0_1 (GP _) ltac:(lra)); auto.
      - intros x M HM0 H l Hlt. rewrite Rmult_1_l. apply H. exact Hlt.
      - intros M x HM0 H l Hlt. destruct (H l Hlt) as [a [Ha ->]]. rewrite Rabs_Ropp, Rabs_mult, (Rabs_right a) by lra.
        apply Rmult_le_compat; [lra|apply Rabs_pos|lra|]. rewrite S0 by exact Hlt. apply greatest_ok.
      - intros M x HM0 H l Hlt. destruct (H l Hlt) as [a [Ha ->]]. rewrite Rabs_Ropp, Rabs_mult, (Rabs_right a) by lra. rewrite push_eq.
        assert (Rabs (sign (S 0 l)) <= 1).
        { unfold sign. destruct (Rlt_dec 0 (S 0 l)); [rewrite Rabs_R1; lra|]. destruct (Rlt_dec (S 0 l) 0); [rewrite Rabs_left; lra|rewrite Rabs_R0; lra]. }
        pose proof (Rabs_pos (sign (S 0 l))). rewrite <- (Rmult_1_r (M * (Q2R mu1 + Q2R delta))). apply Rmult_le_compat; lra.
      - intros t0 M u HQ HM0 H Hu l Hlt. apply (states_stay c X S t0 P2 P3 Hsrc HQ M u l HM0 H Hu Hlt).
      - intros l Hlt. rewrite X0 by exact Hlt. apply greatest_ok. }
    rewrite Q2R_mult, Q2R_div, !Q2R_inject by (unfold Qeq; cbn [Qnum Qden inject_Z]; lia).
    pose proof (size_dot (nth i (dL d) []) (X t) _ (fun j Hj => K j (Nat.lt_le_trans _ _ _ Hj (dL_len i Hi))) M0) as B.
    apply IZR_lt in Hl. rewrite dL_row, Rabs_mult, (Rabs_right (IZR (dls d))) in B by (exact Hi || lra).
    apply (Rmult_le_reg_l (IZR (dls d))); [exact Hl|]. eapply Rle_trans; [exact B|]. apply Req_le. field. lra. }
  rewrite nth_indep with (d' := (fun r => lesser me (inject_Z (size r) / inject_Z (dls d) * mx)%Q) []) by (rewrite map_length; unfold d; rewrite len_dL; exact Hi).
  rewrite (map_nth (fun r => lesser me (inject_Z (size r) / inject_Z (dls d) * mx)%Q)). unfold lesser. destruct (Qle_bool _ _); assumption.
Qed.
End Largest.
