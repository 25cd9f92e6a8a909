(** Reaching times: [int dr/psi(r)] from below, by power series on panels, and when a sliding variable is 0 by it. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Certificate Checker Flow Sound Slide Solution Exist Effort Peak.
Open Scope R_scope.

(** * Polynomials with rational coefficients *)
Fixpoint poly (l : list Q) (v : R) : R := match l with [] => 0 | a :: l' => Q2R a + v * poly l' v end.
Fixpoint dpoly (l : list Q) (v : R) : R := match l with [] => 0 | a :: l' => poly l' v + v * dpoly l' v end.
Lemma poly_derive l v : is_derive (poly l) v (dpoly l v).
Proof.
  induction l as [|a l IH]; simpl; [apply @is_derive_const|]. evar_last.
  - apply @is_derive_plus; [apply @is_derive_const|]. apply (is_derive_times (fun v => v) (poly l)); [apply @is_derive_id|exact IH].
  - unfold plus, zero, one; simpl. ring.
Qed.
Lemma evaluate_ok l v : Q2R (evaluate l v) = poly l (Q2R v).
Proof. induction l as [|a l IH]; simpl; [unfold Q2R; simpl; lra|]. rewrite Q2R_plus, Q2R_mult, IH. reflexivity. Qed.
Lemma low_ok l v : 0 <= v <= 1 -> Q2R (low l) <= poly l v.
Proof.
  intros Hv. induction l as [|a l IH]; cbn [low poly]; [unfold Q2R; simpl; lra|]. destruct (Qle_bool 0 (low l)) eqn:E.
  - apply Qle_bool_iff, Qle_Rle in E. replace (Q2R 0) with 0 in E by (unfold Q2R; simpl; lra). nra.
  - assert (E' : Q2R (low l) < 0).
    { replace 0 with (Q2R 0) by (unfold Q2R; simpl; lra). apply Qlt_Rlt, Qnot_le_lt. intros C. apply Qle_bool_iff in C. congruence. }
    rewrite Q2R_plus. nra.
Qed.
Lemma index_S j : Q2R (index (S j)) = Q2R (index j) + 1.
Proof. unfold index. rewrite !Q2R_inject, Nat2Z.inj_succ, succ_IZR. reflexivity. Qed.
Lemma index_pos j : 0 < Q2R (index (S j)).
Proof. unfold index. rewrite Q2R_inject. apply IZR_lt. lia. Qed.
(** [(W (1 - v) + m) P - (1 - v) P'] *)
Lemma residual_ok W m v : forall l prev j, poly (residual W m prev j l) v =
  (Q2R m + Q2R W + Q2R (index j)) * poly l v + v * dpoly l v - Q2R W * (Q2R prev + v * poly l v)
  - (Q2R (index (S j)) * poly (tl l) v + v * dpoly (tl l) v).
Proof.
  induction l as [|c l IH]; intros prev j; cbn [residual poly dpoly tl].
  - rewrite Q2R_opp, Q2R_mult. ring.
  - rewrite IH, !Q2R_minus, !Q2R_mult, !Q2R_plus. rewrite !index_S.
    destruct l as [|d l]; cbn [hd tl poly dpoly]; [replace (Q2R 0) with 0 by (unfold Q2R; simpl; lra)|]; ring.
Qed.
Lemma integrated_ok v : forall l j, Q2R (index (S j)) * poly (integrated j l) v + v * dpoly (integrated j l) v = poly l v.
Proof.
  induction l as [|c l IH]; intros j; cbn [integrated poly dpoly]; [ring|]. rewrite <- (IH (S j)).
  pose proof (index_pos j) as P. rewrite Q2R_div, (index_S (S j)).
  2: { intros E. apply Qeq_eqR in E. replace (Q2R 0) with 0 in E by (unfold Q2R; simpl; lra). lra. }
  field. lra.
Qed.

Section Reach.
Variables (c : cert) (T_r T_s mu1 mu2 mu3 delta : Q).
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hkind : kind c = SlidingMode T_r T_s mu1 mu2 mu3 delta.
Let Tr := Q2R T_r.
Let w := psi c T_r mu2 mu3.
Let p := pull c T_r mu2 mu3.
Let m := (mu3 * kappa c)%Q.
Let above := parts c T_r T_s mu1 mu2 mu3 delta Hprot Hkind.
Let w_derive t : t < Tr -> is_derive w t (- (p t * w t)) := psi_derive c T_r T_s mu1 mu2 mu3 delta Hprot Hkind t.
Let w_pos t : 0 < w t := psi_pos c T_r mu2 mu3 t.
Let spent := spent c T_r mu2 mu3.
Let spent_derive t : t < Tr -> is_derive spent t (/ w t) := spent_derive c T_r T_s mu1 mu2 mu3 delta Hprot Hkind t.

(** * One panel, that begins at [T_r - near] *)
Section Panel.
Variables (near H : R) (W : Q) (l : list Q).
Hypotheses (N0 : 0 < near <= Tr) (EW : Q2R W = Q2R mu2 * near) (H0 : 0 <= H <= / w (Tr - near)).
Hypotheses (L0 : poly l 0 <= 1) (LR : 0 <= Q2R (low (residual W m 0 0 l))).
Let at_ t := (t - (Tr - near)) / near.
Lemma at_derive t : is_derive at_ t (/ near).
Proof. unfold at_. auto_derive; [exact I|]. field. lra. Qed.
Lemma at_range t : Tr - near <= t < Tr -> 0 <= at_ t < 1.
Proof.
  intros Ht. unfold at_. split; [apply Rmult_le_pos; [lra|left; apply Rinv_0_lt_compat; lra]|].
  apply (Rmult_lt_reg_r near); [lra|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l; lra.
Qed.
Lemma poly_at_derive l' t : is_derive (fun u => poly l' (at_ u)) t (/ near * dpoly l' (at_ t)).
Proof. apply (is_derive_after (poly l') at_); [apply poly_derive|apply at_derive]. Qed.
Lemma grows t : Tr - near <= t < Tr -> dpoly l (at_ t) / near <= p t * poly l (at_ t).
Proof.
  intros Ht. pose proof (at_range t Ht) as A. pose proof (low_ok (residual W m 0 0 l) (at_ t) ltac:(lra)) as R.
  rewrite residual_ok in R. assert (E : Q2R (index 1) * poly (tl l) (at_ t) + at_ t * dpoly (tl l) (at_ t) = dpoly l (at_ t)).
  { destruct l; cbn [tl poly dpoly]; unfold index; rewrite Q2R_inject; simpl; ring. }
  rewrite E in R. unfold index in R. rewrite Q2R_inject in R. cbn [Z.of_nat] in R. replace (Q2R 0) with 0 in R by (unfold Q2R; simpl; lra).
  set (v := at_ t) in *. set (P := poly l v) in *. set (D := dpoly l v) in *.
  assert (R2 : (1 - v) * D <= (Q2R mu2 * near * (1 - v) + Q2R m) * P) by (rewrite <- EW; lra).
  assert (Ep : p t = Q2R mu2 + Q2R m / (near * (1 - v))).
  { unfold p, pull. fold Tr. destruct (Rlt_dec t Tr) as [_|N]; [|lra]. unfold m. rewrite Q2R_mult. f_equal. f_equal.
    unfold v, at_. field. lra. }
  rewrite Ep. apply (Rmult_le_reg_l (near * (1 - v))); [apply Rmult_lt_0_compat; lra|].
  replace (near * (1 - v) * (D / near)) with ((1 - v) * D) by (field; lra).
  replace (near * (1 - v) * ((Q2R mu2 + Q2R m / (near * (1 - v))) * P)) with ((Q2R mu2 * near * (1 - v) + Q2R m) * P); [exact R2|].
  field. split; lra.
Qed.
Lemma panel_value t : Tr - near <= t < Tr -> H * poly l (at_ t) <= / w t.
Proof.
  intros Ht. pose proof (w_pos t) as P. apply (Rmult_le_reg_l (w t)); [exact P|]. rewrite Rinv_r by lra.
  apply Rle_trans with (w (Tr - near) * (H * poly l (at_ (Tr - near)))).
  - set (dF := fun t => - (p t * w t) * (H * poly l (at_ t)) + w t * (H * (/ near * dpoly l (at_ t)))).
    assert (D : forall u, u < Tr -> is_derive (fun u => w u * (H * poly l (at_ u))) u (dF u)).
    { intros u Hu. unfold dF. apply (is_derive_times w (fun u => H * poly l (at_ u))); [apply w_derive; exact Hu|]. apply (is_derive_scal (fun u => poly l (at_ u))). apply poly_at_derive. }
    apply (decreasing Tr (Tr - near) (fun u => w u * (H * poly l (at_ u))) dF); [intros; apply D; lra| | |exact Ht].
    + intros u Hu. apply @ex_derive_continuous. eexists. apply D. lra.
    + intros u Hu. unfold dF. pose proof (grows u Hu) as G. pose proof (w_pos u) as Q.
      assert (K : 0 <= w u * H) by (apply Rmult_le_pos; lra). apply (Rmult_le_compat_l (w u * H)) in G; [|exact K]. unfold Rdiv in G. lra.
  - replace (at_ (Tr - near)) with 0 by (unfold at_; field; lra). pose proof (w_pos (Tr - near)) as Q.
    apply Rle_trans with (w (Tr - near) * H); [apply Rmult_le_compat_l; [lra|]; nra|].
    apply (Rmult_le_reg_l (/ w (Tr - near))); [apply Rinv_0_lt_compat; exact Q|]. rewrite <- Rmult_assoc, Rinv_l by lra. lra.
Qed.
Lemma panel_integral t : Tr - near <= t < Tr ->
  spent (Tr - near) + H * near * (at_ t * poly (integrated 0 l) (at_ t)) <= spent t.
Proof.
  intros Ht. set (F := fun u => H * near * (at_ u * poly (integrated 0 l) (at_ u)) - spent u).
  set (dF := fun u => H * poly l (at_ u) - / w u).
  assert (D : forall u, u < Tr -> is_derive F u (dF u)).
  { intros u Hu. unfold F, dF. apply @is_derive_minus; [|apply spent_derive; exact Hu]. evar_last.
    - apply (is_derive_scal (fun u => at_ u * poly (integrated 0 l) (at_ u))). apply is_derive_times; [apply at_derive|apply poly_at_derive].
    - rewrite <- (integrated_ok (at_ u) l 0). unfold index. rewrite Q2R_inject. simpl. field. lra. }
  assert (K : F t <= F (Tr - near)).
  { apply (decreasing Tr (Tr - near) F dF); [intros; apply D; lra| | |exact Ht].
    - intros u Hu. apply @ex_derive_continuous. eexists. apply D. lra.
    - intros u Hu. pose proof (panel_value u Hu). unfold dF. lra. }
  unfold F in K. replace (at_ (Tr - near)) with 0 in K by (unfold at_; field; lra). lra.
Qed.
End Panel.

Lemma Qle_0 q : Qle_bool 0 q = true -> 0 <= Q2R q.
Proof. intros E. apply Qle_bool_iff, Qle_Rle in E. replace (Q2R 0) with 0 in E by (unfold Q2R; simpl; lra). exact E. Qed.
Lemma coefficients_0 W prev j n : poly (coefficients W m prev 1 j n) 0 <= 1.
Proof. destruct n; cbn [coefficients poly]; rewrite RMicromega.Q2R_1; lra. Qed.
(** what the panels say, up to [T_r - last] *)
Lemma climb_ok last : Q2R last <= Tr -> forall n near H I, 0 < Q2R near <= Tr -> Q2R last <= Q2R near ->
  0 <= Q2R H <= / w (Tr - Q2R near) -> Q2R I <= spent (Tr - Q2R near) ->
  let r := Q2R (climb mu2 m last near H I n) in 0 < r -> 0 < Q2R last /\ r <= spent (Tr - Q2R last).
Proof.
  intros HL. assert (Z0 : Q2R 0 = 0) by (unfold Q2R; simpl; lra).
  induction n as [|n IH]; intros near H I N0 NL H0 I0; cbn [climb]; cbv zeta; [rewrite Z0; lra|].
  set (W := (mu2 * near)%Q). set (next := following W m last near). set (v := (1 - next / near)%Q).
  set (l := coefficients W m 0 1 0 60).
  destruct (pos next && Qle_bool next near && Qle_bool last next && Qle_bool 0 H && Qle_bool 0 (low (residual W m 0 0 l))) eqn:E; [|rewrite Z0; lra].
  apply andb_prop in E as [E E5]. apply andb_prop in E as [E E4]. apply andb_prop in E as [E E3]. apply andb_prop in E as [E1 E2].
  apply Qpos in E1. apply Qle_bool_iff, Qle_Rle in E2, E3. apply Qle_0 in E4, E5.
  assert (EW : Q2R W = Q2R mu2 * Q2R near) by (unfold W; apply Q2R_mult).
  assert (Ht : Tr - Q2R near <= Tr - Q2R next < Tr) by lra.
  assert (Nz : ~ (near == 0)%Q) by (intros C; apply Qeq_eqR in C; rewrite Z0 in C; lra).
  assert (Ev : Q2R v = (Tr - Q2R next - (Tr - Q2R near)) / Q2R near).
  { unfold v. rewrite Q2R_minus, Q2R_div, RMicromega.Q2R_1 by exact Nz. field. lra. }
  pose proof (panel_value (Q2R near) (Q2R H) W l N0 EW H0 (coefficients_0 W 0 0 60) E5 _ Ht) as PV.
  pose proof (panel_integral (Q2R near) (Q2R H) W l N0 EW H0 (coefficients_0 W 0 0 60) E5 _ Ht) as PI.
  cbv zeta beta in PV, PI. rewrite <- Ev, <- evaluate_ok in PV. rewrite <- Ev, <- evaluate_ok in PI.
  set (I' := floor (I + H * near * (v * evaluate (integrated 0 l) v))).
  assert (KI : Q2R I' <= spent (Tr - Q2R next)).
  { eapply Rle_trans; [apply floor_ok|]. rewrite Q2R_plus, !Q2R_mult. lra. }
  destruct (Qle_bool next last) eqn:El.
  - apply Qle_bool_iff, Qle_Rle in El. replace (Q2R last) with (Q2R next) by lra. intros _. split; [exact E1|exact KI].
  - destruct (Qle_bool 0 (floor (H * evaluate l v))) eqn:Eh.
    + apply Qle_0 in Eh. apply IH; [lra|lra| |exact KI]. split; [exact Eh|]. eapply Rle_trans; [apply floor_ok|]. rewrite Q2R_mult. exact PV.
    + destruct n as [|n]; cbn [climb]; cbv zeta; [rewrite Z0; lra|]. rewrite Eh, andb_false_r. cbn [andb]. rewrite Z0. lra.
Qed.

Variables (X S : R -> nat -> R) (i : nat).
Hypothesis HM : moves c X S.
Hypothesis Hi : (i < order c)%nat.
Lemma stays_0 a t : 0 <= a <= t -> t < deadline c -> S a i = 0 -> S t i = 0.
Proof.
  intros Ha Ht Z. destruct (Req_dec (S t i) 0) as [E|N]; [exact E|]. exfalso. pose proof (Rabs_pos_lt _ N) as P. set (e := Rabs (S t i)) in *.
  assert (K : Rabs (S t i) <= e / 2); [|fold e in K; lra].
  apply (Slide.held c T_r T_s mu1 mu2 mu3 delta Hprot Hkind X S i HM Hi a t (fun _ => e / 2) (fun _ => 0)); [lra|lra| |rewrite Z, Rabs_R0; lra].
  intros u _. split; [apply @is_derive_const|]. split; [lra|].
  pose proof (pull_pos c T_r T_s mu1 mu2 mu3 delta Hprot Hkind u). nra.
Qed.
(** [S = 0] where [|S(0)| < (mu1 - delta) int dr/psi] *)
Lemma reaches_0 b : 0 <= b < Tr -> Rabs (S 0 i) < (Q2R mu1 - Q2R delta) * spent b -> S b i = 0.
Proof.
  intros Hb L. destruct above as [A [M _]]. fold Tr in A. destruct (Req_dec (S b i) 0) as [E|N]; [exact E|]. exfalso.
  assert (NZ : forall t, 0 <= t <= b -> S t i <> 0) by (intros t Ht Z; apply N; apply (stays_0 t); [lra|lra|exact Z]).
  pose proof (Rabs_pos (S 0 i)) as S0. assert (G : 0 < spent b) by (apply Rnot_le_lt; intros C; nra).
  set (r := Rabs (S 0 i) / spent b). assert (R1 : r * spent b = Rabs (S 0 i)) by (unfold r; field; lra).
  assert (R2 : r < Q2R mu1 - Q2R delta) by (apply (Rmult_lt_reg_r (spent b)); [exact G|]; rewrite R1; exact L).
  set (f := fun u => w u * (Rabs (S 0 i) - r * spent u)). set (df := fun u => - (p u * f u) - r).
  assert (D : forall u, u < Tr -> is_derive f u (df u)).
  { intros u Hu. unfold f, df. pose proof (w_pos u) as P. evar_last.
    - apply is_derive_times; [apply w_derive; exact Hu|]. apply @is_derive_minus; [apply @is_derive_const|].
      apply is_derive_scal. apply spent_derive. exact Hu.
    - unfold minus, plus, opp, zero; simpl. unfold f. field. lra. }
  assert (K : Rabs (S b i) <= f b).
  { apply (Slide.slower c T_r T_s mu1 mu2 mu3 delta Hkind X S i HM Hi ((Q2R mu1 - Q2R delta - r) / 2) 0 b f df); [lra|lra|lra| | |].
    - intros t Ht. apply D. lra.
    - intros t Ht _. split; [apply NZ; lra|unfold df, p; lra].
    - unfold f, spent, Exist.spent. rewrite RInt_point. unfold w.
      rewrite (psi_0 c T_r T_s mu1 mu2 mu3 delta Hprot Hkind). unfold zero; simpl. lra. }
  unfold f in K. rewrite R1 in K. pose proof (Rabs_pos_lt _ N). lra.
Qed.
Lemma reaching_part z t : arrives c T_r mu1 mu2 mu3 delta (nth i (sliding c) 0%Q) z = true ->
  S 0 i = Q2R (nth i (sliding c) 0%Q) -> Tr * (1 - exp (- Q2R z)) <= t < deadline c -> S t i = 0.
Proof.
  intros H H0 Ht. destruct above as [A [M _]]. fold Tr in A. unfold arrives in H. apply andb_prop in H as [Hz H]. apply Qle_0 in Hz.
  pose proof (exp_pos (- Q2R z)) as E0.
  assert (E1 : exp (- Q2R z) <= 1).
  { rewrite <- exp_0. destruct Hz as [Hz|Hz]; [left; apply exp_increasing; lra|rewrite <- Hz, Ropp_0; lra]. }
  assert (T0 : 0 <= Tr * (1 - exp (- Q2R z))) by (apply Rmult_le_pos; lra).
  apply orb_prop in H as [H|H].
  - apply Qeq_bool_eq, Qeq_eqR in H. apply (stays_0 0 t); [lra|lra|]. rewrite H0, H. unfold Q2R; simpl; lra.
  - apply andb_prop in H as [H5 H]. apply andb_prop in H as [H6 H]. apply Qpos in H5. apply Qle_bool_iff, Qle_Rle in H6.
    set (g := floor (horner z 0 100)) in *. set (last := (T_r / g)%Q) in *.
    assert (G : Q2R g <= exp (Q2R z)) by (eapply Rle_trans; [apply floor_ok|]; apply horner_ok; exact Hz).
    assert (EL : Q2R last = Tr / Q2R g).
    { unfold last. rewrite Q2R_div; [reflexivity|]. intros C. apply Qeq_eqR in C. unfold Q2R in C at 2; simpl in C. lra. }
    set (r := climb mu2 m last T_r 1 0 1000) in *.
    assert (L : Rabs (S 0 i) < (Q2R mu1 - Q2R delta) * Q2R r).
    { rewrite H0. apply negb_true_iff in H. set (q := nth i (sliding c) 0%Q) in *.
      replace (Rabs (Q2R q)) with (Q2R (Qabs q)).
      2: { destruct q as [x d]. unfold Q2R. simpl. rewrite abs_IZR, Rabs_mult. f_equal. symmetry. apply Rabs_right.
           apply Rle_ge. left. apply Rinv_0_lt_compat. apply IZR_lt. reflexivity. }
      rewrite <- Q2R_minus, <- Q2R_mult. apply Qlt_Rlt, Qnot_le_lt. intros C. apply Qle_bool_iff in C. unfold r, m in C. congruence. }
    assert (R0 : 0 < Q2R r) by (pose proof (Rabs_pos (S 0 i)); apply Rnot_le_lt; intros C; nra).
    assert (W0 : / w (Tr - Q2R T_r) = 1).
    { unfold Tr. rewrite Rminus_eq_0. unfold w. rewrite (psi_0 c T_r T_s mu1 mu2 mu3 delta Hprot Hkind). apply Rinv_1. }
    destruct (climb_ok last H6 1000 T_r 1 0) as [L0 L1]; [fold Tr; lra|exact H6| | |exact R0|].
    + rewrite W0, RMicromega.Q2R_1. lra.
    + unfold Tr. rewrite Rminus_eq_0. unfold spent, Exist.spent. rewrite RInt_point, Q2R_0. apply Rle_refl.
    + assert (B : Tr - Q2R last <= Tr * (1 - exp (- Q2R z))).
      { rewrite EL, exp_Ropp. assert (/ exp (Q2R z) <= / Q2R g) by (apply Rinv_le_contravar; assumption). unfold Rdiv. nra. }
      fold Tr in H6. apply (stays_0 (Tr - Q2R last)); [lra|lra|]. apply reaches_0; [lra|]. eapply Rlt_le_trans; [exact L|].
      apply Rmult_le_compat_l; [lra|exact L1].
Qed.
End Reach.

Theorem sliding_ok c : check_protocol c = true -> check_sliding c = true -> sliding_claim c.
Proof.
  intros HP HS. unfold sliding_claim. destruct (kind c) as [|T_r T_s mu1 mu2 mu3 delta] eqn:K; [exact I|]. intros X S HM.
  apply andb_prop in HS as [HS HR]. unfold check_reaching in HR. rewrite K in HR. rewrite forallb_forall in HR.
  destruct (parts c _ _ _ _ _ _ HP K) as [A _]. split.
  - split; [lra|]. intros t i Ht Hi. apply (rests c _ _ _ _ _ _ HP K X S i HM Hi t Ht).
  - intros t i Ht Hi. split; [apply (shrinks c _ _ _ _ _ _ HP K X S i HM Hi t Ht)|]. intros H0. split.
    + intros Hl. apply (input_part c _ _ _ _ _ _ HP K X S i HM Hi t (sliding_input c) HS eq_refl Ht Hl H0).
    + intros z Hz Hq. assert (Hl : (i < length (reaching c))%nat).
      { destruct (Nat.lt_ge_cases i (length (reaching c))) as [L|L]; [exact L|]. rewrite nth_overflow in Hz by exact L. discriminate. }
      specialize (HR i ltac:(apply in_seq; lia)). rewrite Hz in HR.
      apply (reaching_part c _ _ _ _ _ _ HP K X S i HM Hi z t HR H0). lra.
Qed.
