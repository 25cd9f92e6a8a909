(** From every state a motion starts, so that nothing that is said of all motions is void. *)
Require Import QArith Qreals List Bool Reals Lra Lia.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Certificate Checker Flow Sound Slide Linear.
Open Scope R_scope.

(** [lap] as a matrix, of more rows than there are nodes in the edges *)
Definition entry (es : list edge) (i j : nat) : R := lap es (fun l => if (l =? j)%nat then 1 else 0) i.
Lemma lap_sum n x i : forall es, (i < n)%nat -> (forall e, In e es -> (src e < n)%nat) ->
  sum n (fun j => entry es i j * x j) = lap es x i.
Proof.
  induction es as [|e es IH]; intros Hi H; [apply sum_zero; intros; unfold entry; simpl; ring|].
  rewrite (sum_ext n _ (fun j => (if (tgt e =? i)%nat then Rabs (Q2R (wt e)) else 0) * ((if (j =? i)%nat then 1 else 0) * x j)
    + ((if (tgt e =? i)%nat then - Q2R (wt e) else 0) * ((if (j =? src e)%nat then 1 else 0) * x j) + entry es i j * x j))).
  - rewrite sum_plus, sum_plus, !sum_scal, !sum_one, IH by auto using in_eq, in_cons. simpl. unfold lap_edge.
    destruct (tgt e =? i)%nat; ring.
  - intros j _. unfold entry, lap. simpl. unfold lap_edge at 1. rewrite (Nat.eqb_sym i j), (Nat.eqb_sym (src e) j).
    destruct (tgt e =? i)%nat; ring.
Qed.
Lemma gain_continuous T r k t : t < T -> continuous (gain T r k) t.
Proof. intros H. apply @ex_derive_continuous. unfold gain. auto_derive. lra. Qed.

(** a motion with given sliding variables *)
Theorem driven n es T r k (S : R -> nat -> R) (x0 : nat -> R) : 0 < T -> (forall t i, t < T -> continuous (fun u => S u i) t) ->
  exists X, motion n (lap es) T r k X (fun t => S (Rmax 0 t)) /\ forall i, (i < n)%nat -> X 0 i = x0 i.
Proof.
  intros HT C. set (N := Datatypes.S (list_max (n :: map src es))).
  assert (HN : forall l, In l (n :: map src es) -> (l < N)%nat).
  { intros l Hl. pose proof (proj1 (list_max_le (n :: map src es) _) (Nat.le_refl _)) as F. rewrite Forall_forall in F.
    specialize (F l Hl). unfold N. lia. }
  assert (Hn : forall i, (i < n)%nat -> (i < N)%nat) by (intros i Hi; pose proof (HN n (or_introl eq_refl)); lia).
  set (R0 := fun t => S (Rmax 0 t)).
  assert (CR : forall t i, t < T -> continuous (fun u => R0 u i) t).
  { intros t i Ht. apply (continuous_comp (Rmax 0) (fun u => S u i)); [apply continuous_Rmax|].
    apply C. apply Rmax_lub_lt; lra. }
  set (Y := solution N (entry es) (clock T r k) (gain T r k) R0 (fun i => x0 i - S 0 i)).
  assert (CY : forall t i, t < T -> (i < n)%nat ->
    is_derive (fun u => Y u i) t (- (gain T r k t * lap es (fun j => Y t j + R0 t j) i))).
  { intros t i Ht Hi. rewrite <- (lap_sum N) by (auto; intros e He; apply HN; right; apply in_map; exact He).
    apply (solution_derive N (entry es) T); auto; intros; [apply clock_derive|apply gain_continuous]; assumption. }
  exists (fun t i => Y t i + R0 t i). split; [split|].
  - intros t i Ht Hi. apply (is_derive_ext (fun u => Y u i)); [intros u; unfold R0; simpl; ring|]. apply CY; [lra|exact Hi].
  - intros t i Ht Hi. assert (Hm : Rmax 0 t < T) by (apply Rmax_lub_lt; assumption).
    assert (CR0 : continuous (fun u => R0 (Rmax 0 u) i) t).
    { apply (continuous_comp (Rmax 0) (fun u => R0 u i)); [apply continuous_Rmax|apply CR; exact Hm]. }
    split; [|exact CR0]. apply (continuous_plus (fun u => Y (Rmax 0 u) i) (fun u => R0 (Rmax 0 u) i)); [|exact CR0].
    apply (continuous_comp (Rmax 0) (fun u => Y u i)); [apply continuous_Rmax|]. apply @ex_derive_continuous. eexists.
    apply CY; assumption.
  - intros i Hi. unfold Y, R0. rewrite solution_0, Rmax_left; [ring|lra|apply clock_0; exact HT|auto].
Qed.

(** * Sliding variables: S' = - (mu1 - delta) sgn(S) - pull S until S = 0, so with the disturbance that slows them most *)
Section Slides.
Variables (c : cert) (T_r T_s mu1 mu2 mu3 delta : Q).
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hkind : kind c = SlidingMode T_r T_s mu1 mu2 mu3 delta.
Let Tr := Q2R T_r.
Let w := psi c T_r mu2 mu3.
Let p := pull c T_r mu2 mu3.
Let above := parts c T_r T_s mu1 mu2 mu3 delta Hprot Hkind.
Let w_derive t : t < Tr -> is_derive w t (- (p t * w t)) := psi_derive c T_r T_s mu1 mu2 mu3 delta Hprot Hkind t.
Let w_pos t : 0 < w t := psi_pos c T_r mu2 mu3 t.
Definition spent t := RInt (fun u => / w u) 0 t.
Definition remains (q t : R) : R := if Rlt_dec t Tr then w t * Rmax 0 (1 - q * spent t) else 0.
Lemma w_continuous t : t < Tr -> continuous w t.
Proof. intros H. apply @ex_derive_continuous. eexists. apply w_derive. exact H. Qed.
Lemma inverse_continuous t : t < Tr -> continuous (fun u => / w u) t.
Proof. intros H. apply (continuous_comp w Rinv); [apply w_continuous; exact H|]. apply continuous_Rinv. pose proof (w_pos t). lra. Qed.
Lemma spent_derive t : t < Tr -> is_derive spent t (/ w t).
Proof. intros H. apply (primitive (fun u => / w u) Tr); [apply above|apply inverse_continuous|exact H]. Qed.
Lemma spent_pos t : 0 <= t < Tr -> 0 <= spent t.
Proof.
  intros H. apply RInt_ge_0; [lra| |].
  - apply (@ex_RInt_continuous R_CompleteNormedModule). intros z Hz. apply inverse_continuous. rewrite Rmax_right in Hz by lra. lra.
  - intros u _. left. apply Rinv_0_lt_compat. apply w_pos.
Qed.
Lemma product_derive q t : t < Tr -> is_derive (fun u => w u * (1 - q * spent u)) t (- (p t * (w t * (1 - q * spent t))) - q).
Proof.
  intros H. pose proof (w_pos t) as P. evar_last.
  - apply is_derive_times; [apply w_derive; exact H|]. apply @is_derive_minus; [apply @is_derive_const|].
    apply is_derive_scal. apply spent_derive. exact H.
  - unfold minus, plus, opp, zero; simpl. field. lra.
Qed.
Lemma soon (a b : R) : a < b -> locally a (fun u => u < b).
Proof.
  intros H. assert (He : 0 < b - a) by lra. exists (mkposreal _ He). intros u Hu. change (Rabs (u - a) < b - a) in Hu.
  apply Rabs_def2 in Hu. lra.
Qed.
Lemma remains_continuous q t : 0 < q -> 0 <= t -> continuous (remains q) t.
Proof.
  intros Hq Ht. destruct above as [A [_ [_ Pm]]]. fold Tr in A. destruct (Rtotal_order t Tr) as [L|[->|L]].
  - apply (continuous_ext_loc _ (fun u => w u * Rmax 0 (1 - q * spent u))).
    + eapply filter_imp; [|apply (soon t Tr L)]. intros u Hu. unfold remains. destruct (Rlt_dec u Tr); [reflexivity|contradiction].
    + apply continuous_times; [apply w_continuous; exact L|].
      apply (continuous_comp (fun u => 1 - q * spent u) (Rmax 0)); [|apply continuous_Rmax].
      apply @ex_derive_continuous. eexists. apply @is_derive_minus; [apply @is_derive_const|].
      apply is_derive_scal. apply spent_derive. exact L.
  - apply filterlim_locally. intros e. set (z := Q2R mu3 * Q2R (kappa c)) in *. set (y := exp (ln e / z)).
    assert (Y : 0 < y) by apply exp_pos. assert (He : 0 < Rmin Tr (Tr * y)) by (apply Rmin_pos; [lra|apply Rmult_lt_0_compat; lra]).
    exists (mkposreal _ He). intros u Hu. change (Rabs (u - Tr) < Rmin Tr (Tr * y)) in Hu. apply Rabs_def2 in Hu.
    pose proof (Rmin_l Tr (Tr * y)). pose proof (Rmin_r Tr (Tr * y)).
    change (Rabs (remains q u - remains q Tr) < e). unfold remains. destruct (Rlt_dec Tr Tr) as [N|_]; [lra|].
    destruct (Rlt_dec u Tr) as [L|_]; [|rewrite Rminus_0_r, Rabs_R0; apply cond_pos]. rewrite Rminus_0_r.
    pose proof (w_pos u) as P. pose proof (spent_pos u ltac:(lra)) as G.
    assert (G2 : 0 <= q * spent u) by (apply Rmult_le_pos; lra).
    assert (B : 0 <= Rmax 0 (1 - q * spent u) <= 1) by (split; [apply Rmax_l|apply Rmax_lub; lra]).
    rewrite Rabs_right by (apply Rle_ge, Rmult_le_pos; lra). apply Rle_lt_trans with (w u); [nra|].
    eapply Rle_lt_trans; [apply (psi_power c T_r T_s mu1 mu2 mu3 delta Hprot Hkind u); lra|]. fold Tr z.
    rewrite <- (exp_ln e) by apply cond_pos. unfold Rpower. apply exp_increasing.
    assert (Z : 0 < (Tr - u) / Tr < y).
    { split; [apply Rdiv_lt_0_compat; lra|]. apply (Rmult_lt_reg_r Tr); [lra|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l; lra. }
    assert (K : ln ((Tr - u) / Tr) < ln e / z) by (rewrite <- (ln_exp (ln e / z)); apply ln_increasing; apply Z).
    apply (Rmult_lt_compat_l z) in K; [|exact Pm]. replace (z * (ln e / z)) with (ln e) in K by (field; lra). exact K.
  - apply (continuous_ext_loc _ (fun _ => 0)); [|apply continuous_const]. assert (He : 0 < t - Tr) by lra.
    exists (mkposreal _ He). intros u Hu. change (Rabs (u - t) < t - Tr) in Hu. apply Rabs_def2 in Hu.
    unfold remains. destruct (Rlt_dec u Tr); [lra|reflexivity].
Qed.
Lemma remains_0 q : remains q 0 = 1.
Proof.
  unfold remains, spent. destruct above as [A _]. fold Tr in A. destruct (Rlt_dec 0 Tr) as [_|N]; [|lra].
  rewrite RInt_point. unfold w. rewrite (psi_0 c T_r T_s mu1 mu2 mu3 delta Hprot Hkind). unfold zero; simpl. rewrite Rmax_right; lra.
Qed.
Lemma remains_pos q t : 0 <= remains q t.
Proof. unfold remains. destruct (Rlt_dec t Tr); [|lra]. apply Rmult_le_pos; [left; apply w_pos|apply Rmax_l]. Qed.
(** its derivative where it is not 0 *)
Lemma remains_falls q t : remains q t <> 0 -> is_derive (remains q) t (- (p t * remains q t) - q).
Proof.
  intros H. unfold remains in H. destruct (Rlt_dec t Tr) as [L|]; [|contradiction].
  assert (G : 0 < 1 - q * spent t).
  { apply Rnot_le_lt. intros G. apply H. rewrite Rmax_left by exact G. ring. }
  assert (E : remains q t = w t * (1 - q * spent t)).
  { unfold remains. destruct (Rlt_dec t Tr); [|contradiction]. rewrite Rmax_right by lra. reflexivity. }
  rewrite E. apply (is_derive_ext_loc (fun u => w u * (1 - q * spent u))); [|apply product_derive; exact L].
  assert (C : continuous (fun u => 1 - q * spent u) t).
  { apply @ex_derive_continuous. eexists. apply @is_derive_minus; [apply @is_derive_const|].
    apply is_derive_scal. apply spent_derive. exact L. }
  assert (N : locally t (fun u => 0 < 1 - q * spent u)) by (apply (C (fun v => 0 < v)), open_gt; exact G).
  eapply filter_imp; [|apply filter_and; [exact N|exact (soon t Tr L)]]. intros u [U1 U2]. unfold remains.
  destruct (Rlt_dec u Tr); [|contradiction]. rewrite Rmax_right by lra. reflexivity.
Qed.

(** the sliding variable that starts at [a] *)
Let r := Q2R mu1 - Q2R delta.
Definition slide (a t : R) : R := if Req_EM_T a 0 then 0 else a * remains (r / Rabs a) t.
Lemma rate_pos a : a <> 0 -> 0 < r / Rabs a.
Proof. intros H. destruct above as [_ [M _]]. apply Rdiv_lt_0_compat; [exact M|apply Rabs_pos_lt; exact H]. Qed.
Lemma slide_continuous a t : 0 <= t -> continuous (slide a) t.
Proof.
  intros Ht. destruct (Req_EM_T a 0) as [E|N].
  - apply (continuous_ext (fun _ => 0)); [|apply continuous_const]. intros u. unfold slide. destruct (Req_EM_T a 0); [reflexivity|contradiction].
  - apply (continuous_ext (fun u => a * remains (r / Rabs a) u)); [intros u; unfold slide; destruct (Req_EM_T a 0); [contradiction|reflexivity]|].
    apply continuous_times; [apply continuous_const|]. apply remains_continuous; [apply rate_pos; exact N|exact Ht].
Qed.
Lemma slide_0 a : slide a 0 = a.
Proof. unfold slide. destruct (Req_EM_T a 0) as [->|_]; [reflexivity|]. rewrite remains_0. ring. Qed.
Lemma slide_law a t e : slide a t <> 0 -> 0 < e -> exists eta, 0 < eta /\ forall h, 0 < h < eta ->
  Rabs (Rabs (slide a (t + h)) - (Rabs (slide a t) - h * (Q2R mu1 + p t * Rabs (slide a t)))) <= h * (Q2R delta + e).
Proof.
  unfold slide. destruct (Req_EM_T a 0) as [E|N]; [intros H; contradiction (H eq_refl)|]. intros H He.
  set (q := r / Rabs a) in *. pose proof (Rabs_pos_lt a N) as A.
  assert (H2 : remains q t <> 0) by (intros Z; apply H; rewrite Z; ring).
  pose proof (remains_falls q t H2) as D. apply is_derive_Reals in D.
  destruct (D (e / Rabs a) ltac:(apply Rdiv_lt_0_compat; assumption)) as [d Hd]. exists d. split; [apply cond_pos|]. intros h Hh.
  specialize (Hd h ltac:(lra) ltac:(rewrite Rabs_right; lra)). apply Rabs_def2 in Hd as [Hd Hl].
  rewrite !Rabs_mult, !(Rabs_right (remains _ _)) by (apply Rle_ge, remains_pos).
  apply (Rmult_lt_compat_l (h * Rabs a)) in Hd; [|apply Rmult_lt_0_compat; lra].
  apply (Rmult_lt_compat_l (h * Rabs a)) in Hl; [|apply Rmult_lt_0_compat; lra].
  replace (h * Rabs a * (e / Rabs a)) with (h * e) in Hd by (field; lra).
  replace (h * Rabs a * - (e / Rabs a)) with (- (h * e)) in Hl by (field; lra).
  replace (h * Rabs a * ((remains q (t + h) - remains q t) / h - (- (p t * remains q t) - q)))
    with (Rabs a * remains q (t + h) - Rabs a * remains q t + h * (p t * (Rabs a * remains q t)) + h * r) in Hd, Hl
    by (unfold q; field; lra).
  assert (Dp : 0 <= h * Q2R delta) by (apply Rmult_le_pos; [lra|apply (delta_pos c T_r T_s mu1 mu2 mu3 delta Hprot Hkind)]).
  unfold r in *. apply Rabs_le. split; lra.
Qed.
End Slides.

Theorem motions_exist c : check_protocol c = true -> existence c.
Proof.
  intros HP x0 s0 H0. destruct (kind c) as [T|T_r T_s mu1 mu2 mu3 delta] eqn:K.
  - assert (HT : 0 < deadline c).
    { unfold check_protocol in HP. rewrite K in HP. apply andb_prop in HP as [_ HP]. apply Qpos in HP. unfold deadline. rewrite K. exact HP. }
    destruct (driven (order c) (edges c) (deadline c) (Q2R (rho1 c)) (k c) (fun _ _ => 0) x0 HT) as [X [M B]].
    { intros; apply continuous_const. }
    exists X, (fun _ _ => 0). split; [split; [exact M|]|]; [unfold slides; rewrite K; reflexivity|].
    intros i Hi. split; [apply B; exact Hi|]. symmetry. apply (H0 T i eq_refl).
  - destruct (parts c _ _ _ _ _ _ HP K) as [A _].
    set (S := fun t i => slide c T_r mu1 mu2 mu3 delta (s0 i) (Rmax 0 t)).
    destruct (driven (order c) (edges c) (deadline c) (Q2R (rho1 c)) (k c) S x0 ltac:(lra)) as [X [M B]].
    { intros t i _. apply (continuous_comp (Rmax 0) (slide c T_r mu1 mu2 mu3 delta (s0 i))); [apply continuous_Rmax|].
      apply (slide_continuous c _ _ _ _ _ _ HP K). apply Rmax_l. }
    exists X, (fun t => S (Rmax 0 t)). split; [split; [exact M|]|].
    + unfold slides. rewrite K. intros t i e Ht _ N He.
      assert (E : forall u, 0 <= u -> S (Rmax 0 u) i = slide c T_r mu1 mu2 mu3 delta (s0 i) u).
      { intros u Hu. unfold S. rewrite !(Rmax_right 0 u) by exact Hu. reflexivity. }
      rewrite E in N by lra. destruct (slide_law c _ _ _ _ _ _ HP K (s0 i) t e N He) as [eta [H1 H2]].
      exists eta. split; [exact H1|]. intros h Hh. rewrite (E t), (E (t + h)) by lra. apply H2. exact Hh.
    + intros i Hi. split; [apply B; exact Hi|]. unfold S. rewrite !(Rmax_left 0 0) by lra. apply (slide_0 c _ _ _ _ _ _ HP K).
Qed.
