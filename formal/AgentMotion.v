(** Motions of agents of order n: the curve of all derivatives in powers of the gain, and how it moves. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia Psatz FunctionalExtensionality.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require FamilyFlow.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Slide Main Weighted AgentCertificate AgentForms AgentFall.
Open Scope R_scope.

(** * The Laplacian and a Lyapunov function beside combinations of states *)
Lemma lap_two es q x z j : lap es (fun j => q * x j + z j) j = q * lap es x j + lap es z j.
Proof. unfold lap. induction es as [|e es IH]; simpl; [ring|]. rewrite IH. unfold lap_edge. destruct (tgt e =? j)%nat; ring. Qed.
Lemma lap_comb es n l Z : lap es (comb n l Z) = comb n l (fun i => lap es (Z i)).
Proof.
  apply functional_extensionality. intros j. unfold comb, sum. generalize (seq 0 n) as s. induction s as [|i s IH]; simpl.
  - unfold lap. induction es as [|e es IH]; simpl; [reflexivity|]. rewrite IH. unfold lap_edge. destruct (tgt e =? j)%nat; ring.
  - rewrite <- IH. apply lap_two.
Qed.
Section Function.
Variables (c : cert) (f : func).
Let d := prepare c.
Hypothesis Hls : good (dls d) (map wt (edges c)) = true.
Variables (F : mat) (m : Z).
Hypothesis EF : Checker.form (order c) (dls d) (dL d) (ly f) = Some (F, m).
Hypothesis He : check_ends c d f = true.
Let es := edges c.
Let S := pair es (ly f).
Lemma V_bil x : V es (ly f) x = bil F x x / IZR m.
Proof.
  destruct (form_ok _ _ _ _ _ _ _ Hls eq_refl EF) as [M [_ HV]]. apply IZR_lt in M. rewrite HV. fold es. field. lra.
Qed.
Lemma pair_bil x z : S x z = (bil F x z + bil F z x) / (2 * IZR m).
Proof.
  destruct (form_ok _ _ _ _ _ _ _ Hls eq_refl EF) as [M _]. apply IZR_lt in M. unfold S, pair. rewrite !V_bil.
  replace (fun j => x j - z j) with (fun j => x j + -1 * z j) by (apply functional_extensionality; intros; ring).
  rewrite !bil_plus_l, !bil_plus_r, !(bil_scal_l F (-1) z), !(bil_scal_r F (-1)). field. lra.
Qed.
Lemma pair_self x : S x x = V es (ly f) x.
Proof.
  destruct (form_ok _ _ _ _ _ _ _ Hls eq_refl EF) as [M _]. apply IZR_lt in M. rewrite pair_bil, V_bil. field. lra.
Qed.
Lemma pair_positive : positive S.
Proof.
  destruct (form_ok _ _ _ _ _ _ _ Hls eq_refl EF) as [M _]. apply IZR_lt in M. constructor.
  - intros. rewrite !pair_bil. field. lra.
  - intros. rewrite !pair_bil, bil_plus_l, bil_plus_r. field. lra.
  - intros. rewrite !pair_bil, bil_scal_l, bil_scal_r. field. lra.
  - intros x. rewrite pair_self. destruct (ends_ok c f He) as [E0 [E1 _]]. specialize (E1 x). fold es in E1.
    pose proof (norm2_pos (order c) (coords es (ly f) x)). nra.
Qed.
Lemma pair_rate : nonneg (order c) (dsw d) (dfw d) (rate_form (dls d) (dL d) F (rate f)) = true ->
  forall x, Q2R (rate f) * S x x <= 2 * S (lap es x) x.
Proof.
  intros H x. destruct (form_ok _ _ _ _ _ _ _ Hls eq_refl EF) as [M [Hfit _]]. apply IZR_lt in M.
  pose proof (rate_form_ok (order c) (dls d) es (dL d) F (rate f) Hls eq_refl Hfit x (nonneg_ok _ _ _ _ H x)) as K.
  rewrite !pair_bil. apply (Rmult_le_reg_l (IZR m)); [exact M|].
  replace (IZR m * (Q2R (rate f) * ((bil F x x + bil F x x) / (2 * IZR m)))) with (Q2R (rate f) * bil F x x) by (field; lra).
  replace (IZR m * (2 * ((bil F (lap es x) x + bil F x (lap es x)) / (2 * IZR m)))) with (bil F (lap es x) x + bil F x (lap es x)) by (field; lra).
  exact K.
Qed.
Lemma pair_derive (X Z : R -> nat -> R) (dX dZ : nat -> R) (t : R) : (forall j, (j < order c)%nat -> is_derive (fun u : R => X u j) t (dX j)) ->
  (forall j, (j < order c)%nat -> is_derive (fun u : R => Z u j) t (dZ j)) ->
  is_derive (fun u => S (X u) (Z u)) t (S dX (Z t) + S (X t) dZ).
Proof.
  intros HX HZ. destruct (form_ok _ _ _ _ _ _ _ Hls eq_refl EF) as [M [Hfit _]]. apply IZR_lt in M.
  destruct (fits_ok _ _ Hfit) as [F1 F2].
  assert (E : forall u, / (2 * IZR m) * (bil F (X u) (Z u) + bil F (Z u) (X u)) = S (X u) (Z u)) by (intros u; rewrite pair_bil; field; lra).
  apply (is_derive_ext (fun u => / (2 * IZR m) * (bil F (X u) (Z u) + bil F (Z u) (X u))) _ _ _ E).
  evar_last.
  - apply is_derive_scal. apply (is_derive_plus (fun u => bil F (X u) (Z u)) (fun u => bil F (Z u) (X u))).
    + apply (is_derive_bil F (order c) F2); [intros i Hi; apply HX; lia|exact HZ].
    + apply (is_derive_bil F (order c) F2); [intros i Hi; apply HZ; lia|exact HX].
  - rewrite !pair_bil. unfold plus, scal; simpl; unfold mult; simpl.
    change (fun i => dX i) with dX. change (fun i => dZ i) with dZ. field. lra.
Qed.
Lemma pair_continuous (X Z : R -> nat -> R) (t : R) : (forall j, (j < order c)%nat -> continuous (fun u : R => X u j) t) ->
  (forall j, (j < order c)%nat -> continuous (fun u : R => Z u j) t) -> continuous (fun u => S (X u) (Z u)) t.
Proof.
  intros HX HZ. destruct (form_ok _ _ _ _ _ _ _ Hls eq_refl EF) as [M [Hfit _]]. apply IZR_lt in M.
  destruct (fits_ok _ _ Hfit) as [F1 F2].
  assert (E : forall u, / (2 * IZR m) * (bil F (X u) (Z u) + bil F (Z u) (X u)) = S (X u) (Z u)) by (intros u; rewrite pair_bil; field; lra).
  apply (continuous_ext (fun u => / (2 * IZR m) * (bil F (X u) (Z u) + bil F (Z u) (X u))) _ _ E).
  apply (continuous_mult (fun _ => / (2 * IZR m))); [apply continuous_const|].
  apply (continuous_plus (fun u => bil F (X u) (Z u)) (fun u => bil F (Z u) (X u)));
    apply (continuous_bil F (order c) F2); intros i Hi; first [apply HX|apply HZ]; lia.
Qed.
End Function.

Lemma is_derive_sum n (g : R -> nat -> R) dg t : (forall i, (i < n)%nat -> is_derive (fun u => g u i) t (dg i)) ->
  is_derive (fun u => sum n (g u)) t (sum n dg).
Proof.
  intros H. unfold sum. assert (K : forall i, In i (seq 0 n) -> is_derive (fun u => g u i) t (dg i)) by (intros i Hi; apply in_seq in Hi; apply H; lia).
  clear H. induction (seq 0 n) as [|i s IH]; simpl; [apply (is_derive_const 0)|].
  apply (is_derive_plus (fun u => g u i) (fun u => fold_right (fun i a => g u i + a) 0 s)); [apply K; left; reflexivity|].
  apply IH. intros; apply K. right. assumption.
Qed.
Lemma continuous_sum n (g : R -> nat -> R) t : (forall i, (i < n)%nat -> continuous (fun u => g u i) t) -> continuous (fun u => sum n (g u)) t.
Proof.
  intros H. unfold sum. assert (K : forall i, In i (seq 0 n) -> continuous (fun u => g u i) t) by (intros i Hi; apply in_seq in Hi; apply H; lia).
  clear H. induction (seq 0 n) as [|i s IH]; simpl; [apply continuous_const|].
  apply (continuous_plus (fun u => g u i) (fun u => fold_right (fun i a => g u i + a) 0 s)); [apply K; left; reflexivity|].
  apply IH. intros; apply K. right. assumption.
Qed.

(** * The gain, and its clock *)
(** numbers that make the gain positive; the instant at which it reaches its cap; [theta] of the paper, [1/eta]' less *)
Definition positive_gain (a : agents) : Prop := 0 <= Q2R (slope a) /\ forall G, cap a = Some G -> 0 < Q2R G.
Definition uncapped (a : agents) t : R := gain (deadline (graph a)) (Q2R (slope a)) (k (graph a)) t.
Definition corner (a : agents) : R :=
  match cap a with Some G => deadline (graph a) - k (graph a) / (Q2R G - Q2R (slope a)) | None => 0 end.
Definition theta (a : agents) t : R := let free := sq (1 - Q2R (slope a) * / eta a t) / k (graph a) in
  match cap a with Some G => if Rlt_dec (Q2R G) (uncapped a t) then 0 else free | None => free end.
Section Gain.
Variable a : agents.
Let c := graph a.
Let T := deadline c.
Let rho := Q2R (slope a).
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hgain : positive_gain a.
Lemma T_k : 0 < T /\ 0 < k c.
Proof. destruct (T_pos c Hprot) as [A [_ B]]. split; assumption. Qed.
Lemma uncapped_pos t : t < T -> rho < uncapped a t.
Proof.
  intros Ht. destruct T_k as [A B]. unfold uncapped, gain. fold c T rho. assert (0 < k c / (T - t)) by (apply Rdiv_lt_0_compat; lra). lra.
Qed.
Lemma uncapped_continuous t : t < T -> continuous (uncapped a) t.
Proof. apply Exist.gain_continuous. Qed.
Lemma eta_pos t : t < T -> 0 < eta a t.
Proof.
  intros Ht. destruct Hgain as [R0 R1]. fold rho in R0. pose proof (uncapped_pos t Ht) as P. unfold eta. change (gain _ _ _ t) with (uncapped a t).
  destruct (cap a) as [G|]; [|lra]. specialize (R1 G eq_refl). apply Rmin_pos; lra.
Qed.
Lemma eta_continuous t : t < T -> continuous (eta a) t.
Proof.
  intros Ht. pose proof (uncapped_continuous t Ht) as C. unfold eta. change (fun t => _) with (fun t => match cap a with None => uncapped a t | Some G => Rmin (uncapped a t) (Q2R G) end).
  destruct (cap a) as [G|]; [|exact C].
  apply (continuous_ext (fun u => / 2 * (uncapped a u + Q2R G - Rabs (uncapped a u - Q2R G)))).
  { intros u. unfold Rmin, Rabs. destruct (Rle_dec _ _), (Rcase_abs _); lra. }
  apply (continuous_mult (fun _ => / 2)); [apply continuous_const|]. apply (continuous_minus (fun u => uncapped a u + Q2R G)).
  - apply (continuous_plus (uncapped a) (fun _ => Q2R G)); [exact C|apply continuous_const].
  - apply (continuous_comp (fun u => uncapped a u - Q2R G) Rabs); [|apply continuous_Rabs].
    apply (continuous_minus (uncapped a) (fun _ => Q2R G)); [exact C|apply continuous_const].
Qed.
Lemma turns_derive t : t < T -> is_derive (turns a) t (eta a t).
Proof.
  intros Ht. destruct T_k as [A B]. apply (is_derive_RInt (eta a) (turns a) 0 t); [|apply eta_continuous; exact Ht].
  assert (He : 0 < T - t) by lra. exists (mkposreal _ He). intros u Hu. unfold ball in Hu; simpl in Hu;
    unfold AbsRing_ball, abs, minus, plus, opp in Hu; simpl in Hu. apply Rabs_def2 in Hu.
  apply (RInt_correct (eta a)). apply (ex_RInt_continuous (eta a)). intros z [_ Hz]. apply eta_continuous.
  eapply Rle_lt_trans; [exact Hz|]. apply Rmax_lub_lt; lra.
Qed.
Lemma turns_0 : turns a 0 = 0.
Proof. unfold turns. apply (RInt_point 0 (eta a)). Qed.
Lemma uncapped_derive t : t < T -> is_derive (uncapped a) t (k c / sq (T - t)).
Proof.
  intros Ht. unfold uncapped, gain, sq. fold c T. auto_derive; [lra|]. replace (T + - t) with (T - t) by ring. field. lra.
Qed.
Lemma inverse_derive t : t < T -> is_derive (fun u => / uncapped a u) t (- (sq (1 - rho * / uncapped a t) / k c)).
Proof.
  intros Ht. destruct T_k as [A B], Hgain as [R0 _]. fold rho in R0. pose proof (uncapped_pos t Ht) as E. unfold sq. unfold uncapped, gain in E |- *. fold c T rho in E |- *.
  auto_derive.
  - split; [lra|]. split; [|exact I]. apply Rgt_not_eq. replace (T + - t) with (T - t) by ring. lra.
  - replace (T + - t) with (T - t) by ring. assert (0 <= rho * (T - t)) by (apply Rmult_le_pos; lra).
    field. repeat split; lra.
Qed.
(** near an instant that is not the corner the gain is what it is there: free, or at its cap *)
Lemma locally_eta t : t < T -> t <> corner a -> theta a t = sq (1 - rho * / eta a t) / k c /\ locally t (fun u => uncapped a u = eta a u) \/
  theta a t = 0 /\ exists G, cap a = Some G /\ locally t (fun u => Q2R G = eta a u).
Proof.
  intros Ht Hc. destruct T_k as [A B]. unfold theta, corner, eta in *. change (gain (deadline (graph a)) (Q2R (slope a)) (k (graph a))) with (uncapped a) in *.
  destruct (cap a) as [G|]; [|left; split; [reflexivity|]; apply filter_forall; reflexivity].
  destruct (Rlt_dec (Q2R G) (uncapped a t)) as [L|L].
  - right. split; [reflexivity|]. exists G. split; [reflexivity|].
    pose proof (uncapped_continuous t Ht _ (open_gt (Q2R G) _ L)) as C. unfold filtermap in C. revert C. apply filter_imp. intros u Hu. rewrite Rmin_right; lra.
  - left. split; [reflexivity|]. assert (L' : uncapped a t < Q2R G).
    { destruct (Req_dec (uncapped a t) (Q2R G)) as [E|]; [|lra]. exfalso. apply Hc. unfold uncapped, gain in E. fold c T rho in E |- *.
      assert (P : 0 < k c / (T - t)) by (apply Rdiv_lt_0_compat; lra). rewrite <- E.
      replace (rho + k c / (T - t) - rho) with (k c / (T - t)) by ring. field. split; lra. }
    pose proof (uncapped_continuous t Ht _ (open_lt (Q2R G) _ L')) as C. unfold filtermap in C. revert C. apply filter_imp. intros u Hu. rewrite Rmin_left; lra.
Qed.
Lemma zeta_derive t : t < T -> t <> corner a -> is_derive (fun u => / eta a u) t (- theta a t).
Proof.
  intros Ht Hc. destruct (locally_eta t Ht Hc) as [[E L]|[E [G [_ L]]]]; rewrite E.
  - apply (is_derive_ext_loc (fun u => / uncapped a u)); [generalize L; apply filter_imp; intros u Hu; rewrite Hu; reflexivity|].
    rewrite <- (locally_singleton _ _ L). apply inverse_derive. exact Ht.
  - apply (is_derive_ext_loc (fun _ => / Q2R G)); [generalize L; apply filter_imp; intros u Hu; rewrite Hu; reflexivity|].
    rewrite Ropp_0. apply @is_derive_const.
Qed.
Lemma eta_derive t : t < T -> t <> corner a -> exists d, is_derive (eta a) t d /\ 0 <= d /\ k c * d <= sq (eta a t).
Proof.
  intros Ht Hc. destruct T_k as [A B], Hgain as [R0 _]. fold rho in R0. destruct (locally_eta t Ht Hc) as [[_ L]|[_ [G [_ L]]]].
  - exists (k c / sq (T - t)). split; [apply (is_derive_ext_loc (uncapped a)); [exact L|apply uncapped_derive; exact Ht]|].
    split; [left; apply Rdiv_lt_0_compat; [exact B|unfold sq; nra]|]. rewrite <- (locally_singleton _ _ L).
    unfold uncapped, gain. fold c T rho. replace (k c * (k c / sq (T - t))) with (sq (k c / (T - t))) by (unfold sq; field; lra).
    assert (0 < k c / (T - t)) by (apply Rdiv_lt_0_compat; lra). unfold sq. apply Rmult_le_compat; lra.
  - exists 0. split; [apply (is_derive_ext_loc (fun _ => Q2R G)); [exact L|apply @is_derive_const]|]. rewrite Rmult_0_r.
    split; [lra|apply Rle_0_sqr].
Qed.
(** it never falls *)
Lemma eta_grows t u : t <= u < T -> eta a t <= eta a u.
Proof.
  intros H. destruct T_k as [A B]. assert (U : uncapped a t <= uncapped a u).
  { unfold uncapped, gain. fold c T. apply Rplus_le_compat_l. unfold Rdiv. apply Rmult_le_compat_l; [lra|]. apply Rinv_le_contravar; lra. }
  unfold eta. change (gain (deadline (graph a)) (Q2R (slope a)) (k (graph a))) with (uncapped a). destruct (cap a) as [G|]; [|exact U].
  unfold Rmin. destruct (Rle_dec _ _), (Rle_dec _ _); lra.
Qed.
End Gain.
Lemma continuous_power (f : R -> R) m t : continuous f t -> continuous (fun u => f u ^ m) t.
Proof. intros C. induction m as [|m IH]; simpl; [apply continuous_const|apply (continuous_mult f (fun u => f u ^ m)); assumption]. Qed.

(** * The curve *)
Section Curve.
Variables (a : agents) (h : nat -> R) (X : R -> nat -> nat -> R) (Sl : R -> nat -> R).
Let c := graph a.
Let N := order c.
Let n := degree a.
Let T := deadline c.
Let rho := Q2R (slope a).
Let es := edges c.
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hgain : positive_gain a.
Hypothesis Hn : (0 < n)%nat.
Hypothesis HX : flies a h X Sl.

Let T_k := T_k a Hprot.
Let eta_pos t : t < T -> 0 < eta a t := eta_pos a Hprot Hgain t.
(** no sliding variable moves: those that begin at 0 stay there, whatever the disturbance *)
Lemma resting t j : 0 <= t < T -> (j < N)%nat -> Sl t j = 0.
Proof.
  intros Ht Hj. destruct HX as [HS [H0 HM]]. change (graph a) with c in HS, H0, HM. unfold slides in HS. destruct (kind c) as [T0|T_r T_s mu1 mu2 mu3 delta] eqn:K; [apply HS|].
  set (c' := Cert (order c) [] (kind c) (rho1 c) (rho2 c) (kappa c) (comps c) (pieces c) (all_balanced c) (sign_symmetric c) (funcs c)
    (start c) (sliding c) (final c) (enclosed c) (margins c) (leaders c) (upper_bound c) (proved c) (best_diagonal c)
    (best_overshoot c) (bounded_input c) (reaching c) (sliding_input c) (efforts c) (degenerate c) (start_box c)).
  assert (M : moves c' Sl Sl).
  { split.
    - split.
      + intros u i Hu Hi. apply (is_derive_ext (fun _ => 0)); [intros v; symmetry; apply (Rminus_diag_eq (Sl v i) (Sl v i) eq_refl)|]. evar_last; [apply @is_derive_const|].
        unfold zero; simpl. unfold lap. simpl. ring.
      + intros u i Hu Hi. change (deadline c') with T in Hu. destruct (HM u i Hi Hu) as [_ [C _]]. split; exact C.
    - unfold slides. change (kind c') with (kind c). rewrite K. exact HS. }
  assert (HP : check_protocol c' = true) by exact Hprot.
  assert (K' : kind c' = SlidingMode T_r T_s mu1 mu2 mu3 delta) by exact K.
  destruct (Rlt_le_dec t (Q2R T_r)) as [L|L].
  - pose proof (shrinks c' _ _ _ _ _ _ HP K' Sl Sl j M Hj t ltac:(lra)) as B. rewrite H0, Rabs_R0, Rmult_0_r in B by exact Hj.
    pose proof (Rabs_pos (Sl t j)). destruct (Req_dec (Sl t j) 0) as [|Nz]; [assumption|]. pose proof (Rabs_pos_lt _ Nz). lra.
  - apply (rests c' _ _ _ _ _ _ HP K' Sl Sl j M Hj). change (deadline c') with T. lra.
Qed.

Let zeta t := / eta a t.
(** entries of [A_z] *)
Definition entry_at (z th : R) (i l : nat) : R := (if (S i =? l)%nat then 1 else 0) + (if (i =? l)%nat then - (INR i * th) else 0)
  + if (S i =? degree a)%nat then - (at_ (damping a) l + at_ (plant a) l * z ^ (degree a - l)) else 0.
Let Y (u : R) := y a h (X (Rmax 0 u)) u.
Let K := at_ (gains a).
Lemma Y_eq t : 0 <= t -> Y t = y a h (X t) t.
Proof. intros H. unfold Y. rewrite Rmax_right by exact H. reflexivity. Qed.
Lemma y_times x t i j : t < T -> placed h x i j = eta a t ^ i * y a h x t i j.
Proof. intros Ht. unfold y. field. apply pow_nonzero. pose proof (eta_pos t Ht). lra. Qed.
Lemma Y_continuous t i j : t < T -> (i < n)%nat -> (j < N)%nat -> continuous (fun u => Y u i j) t.
Proof.
  intros Ht Hi Hj. unfold Y, y, Rdiv.
  apply (continuous_mult (fun u => placed h (X (Rmax 0 u)) i j) (fun u => / eta a u ^ i)).
  - unfold placed. apply (continuous_minus (fun u => X (Rmax 0 u) i j) (fun _ => if (i =? 0)%nat then h j else 0)); [|apply continuous_const].
    apply HX; assumption.
  - apply (continuous_comp (fun u => eta a u ^ i) Rinv); [apply continuous_power, (eta_continuous a); exact Ht|].
    apply continuous_Rinv. apply pow_nonzero. apply Rgt_not_eq, eta_pos. exact Ht.
Qed.
(** the derivative of a state, however high *)
Let dX t i j := if (S i =? n)%nat then control a h (X t) t j - sum n (fun l => at_ (plant a) l * X t l j) else X t (S i) j.
Lemma near (g g' : R -> R) t d : 0 < t < T -> (forall u, 0 < u < T -> g' u = g u) -> is_derive g t d -> is_derive g' t d.
Proof.
  intros Ht E. apply is_derive_ext_loc. assert (He : 0 < Rmin t (T - t)) by (apply Rmin_pos; lra). exists (mkposreal _ He). intros u Hu.
  unfold ball in Hu; simpl in Hu; unfold AbsRing_ball, abs, minus, plus, opp in Hu; simpl in Hu.
  pose proof (Rmin_l t (T - t)). pose proof (Rmin_r t (T - t)). apply Rabs_def2 in Hu. symmetry. apply E. lra.
Qed.
Lemma X_derive t i j : 0 < t < T -> (i < n)%nat -> (j < N)%nat -> is_derive (fun u => X (Rmax 0 u) i j) t (dX t i j).
Proof.
  intros Ht Hi Hj. destruct HX as [_ [_ HM]]. destruct (HM t j Hj ltac:(apply Ht)) as [D _]. specialize (D (proj1 Ht)).
  unfold dX. destruct (Nat.eqb_spec (S i) n) as [E|E].
  - apply (near (fun u => X u (pred n) j - Sl u j)); [exact Ht| |apply D].
    intros u Hu. rewrite Rmax_right by lra. rewrite (resting u j) by (try assumption; lra). replace (pred n) with i by lia. ring.
  - apply (near (fun u => X u i j)); [exact Ht| |apply D; fold n; lia]. intros u Hu. rewrite Rmax_right by lra. reflexivity.
Qed.
Lemma placed_sum x j : sum n (fun l => at_ (plant a) l * x l j) = at_ (plant a) 0 * h j + sum n (fun l => at_ (plant a) l * placed h x l j).
Proof.
  rewrite (sum_ext n (fun l => at_ (plant a) l * x l j) (fun l => (if (0 =? l)%nat then at_ (plant a) l * h j else 0) + at_ (plant a) l * placed h x l j)).
  - rewrite sum_plus, (sum_at n 0 (fun l => at_ (plant a) l * h j)) by exact Hn. reflexivity.
  - intros l _. unfold placed. destruct l as [|l]; simpl; ring.
Qed.
Lemma Y_derive t i j : 0 < t < T -> t <> corner a -> (i < n)%nat -> (j < N)%nat ->
  is_derive (fun u => Y u i j) t (eta a t * moving (lap es) n (entry_at (zeta t) (theta a t)) K (Y t) i j).
Proof.
  intros Ht Hcorner Hi Hj. pose proof (eta_pos t ltac:(lra)) as E0.
  assert (D : is_derive (fun u => placed h (X (Rmax 0 u)) i j * zeta u ^ i) t
    (dX t i j * zeta t ^ i + placed h (X (Rmax 0 t)) i j * (INR i * - theta a t * zeta t ^ pred i))).
  { apply (is_derive_mult (fun u => placed h (X (Rmax 0 u)) i j) (fun u => zeta u ^ i)).
    - unfold placed. evar_last. { apply (is_derive_minus (fun u => X (Rmax 0 u) i j) (fun _ => if (i =? 0)%nat then h j else 0));
        [apply X_derive; assumption|apply @is_derive_const]. }
      unfold minus, plus, opp, zero; simpl. ring.
    - apply (is_derive_pow zeta i). apply (zeta_derive a Hprot Hgain); [exact (proj2 Ht)|exact Hcorner].
    - intros; apply Rmult_comm. }
  apply (near (fun u => placed h (X (Rmax 0 u)) i j * zeta u ^ i)); [exact Ht| |].
  { intros u Hu. unfold Y, y, Rdiv, zeta. rewrite pow_inv. reflexivity. }
  evar_last; [exact D|]. rewrite Y_eq by lra. rewrite Rmax_right by lra.
  rewrite (y_times (X t) t i j) by lra. unfold moving, comb, entry_at. fold n.
  assert (Z1 : forall m, zeta t ^ m * eta a t ^ m = 1) by (intros m; rewrite <- Rpow_mult_distr; unfold zeta; rewrite Rinv_l by lra; apply pow1).
  assert (Z2 : zeta t * eta a t = 1) by (unfold zeta; apply Rinv_l; lra).
  assert (Z3 : INR i * zeta t ^ pred i = INR i * (eta a t * zeta t ^ i)).
  { destruct i as [|i]; [simpl; ring|]. simpl pred. f_equal. rewrite <- tech_pow_Rmult. rewrite <- Rmult_assoc, (Rmult_comm (eta a t)), Z2. ring. }
  set (e := eta a t) in *. set (z := zeta t) in *. set (th := theta a t) in *. set (v := y a h (X t) t) in *.
  replace (e ^ i * v i j * (INR i * - th * z ^ pred i)) with (- th * v i j * (e ^ i * (INR i * z ^ pred i))) by ring. rewrite Z3.
  replace (- th * v i j * (e ^ i * (INR i * (e * z ^ i)))) with (- th * v i j * INR i * e * (z ^ i * e ^ i)) by ring. rewrite Z1.
  rewrite (sum_ext n _ (fun l => (if (S i =? l)%nat then v l j else 0) + ((if (i =? l)%nat then - (INR i * th) * v l j else 0)
    + (if (S i =? n)%nat then -1 else 0) * ((at_ (damping a) l + at_ (plant a) l * z ^ (n - l)) * v l j)))).
  2: { intros l _. fold n. destruct (S i =? l)%nat, (i =? l)%nat, (S i =? n)%nat; ring. }
  rewrite !sum_plus, sum_scal, (sum_at n i (fun l => - (INR i * th) * v l j)) by exact Hi.
  unfold dX. destruct (Nat.eqb_spec (S i) n) as [E|E].
  - rewrite (sum_zero n (fun l => if (S i =? l)%nat then v l j else 0)) by (intros l Hl; destruct (Nat.eqb_spec (S i) l); [lia|reflexivity]).
    assert (C : (control a h (X t) t j - sum n (fun l => at_ (plant a) l * X t l j)) * z ^ i =
      - e * (sum n (fun l => K l * lap es (v l) j) + sum n (fun l => at_ (damping a) l * v l j)
        + sum n (fun l => at_ (plant a) l * z ^ (n - l) * v l j))).
    { rewrite (placed_sum (X t)). assert (Ctl : control a h (X t) t j = at_ (plant a) 0 * h j -
        e ^ n * sum n (fun l => K l * lap es (v l) j + at_ (damping a) l * v l j)) by reflexivity.
      rewrite Ctl, sum_plus.
      assert (P2 : z ^ i * sum n (fun l => at_ (plant a) l * placed h (X t) l j) = e * sum n (fun l => at_ (plant a) l * z ^ (n - l) * v l j)).
      { rewrite <- !sum_scal. apply sum_ext. intros l Hl. rewrite (y_times (X t) t l j) by lra. fold e v.
        assert (Q1 : z ^ i * e ^ l = e * z ^ (n - l)).
        { replace i with ((n - l - 1) + l)%nat by lia. rewrite pow_add. rewrite Rmult_assoc, Z1.
          replace (n - l)%nat with (S (n - l - 1))%nat at 2 by lia. rewrite <- tech_pow_Rmult, <- Rmult_assoc, (Rmult_comm e), Z2. ring. }
        transitivity (z ^ i * e ^ l * (at_ (plant a) l * v l j)); [ring|]. rewrite Q1. ring. }
      assert (P3 : e ^ n * z ^ i = e) by (replace n with (S i) by lia; rewrite <- tech_pow_Rmult, Rmult_assoc, (Rmult_comm (e ^ i)), Z1; ring).
      set (s1 := sum n (fun l => K l * lap es (v l) j)). set (s2 := sum n (fun l => at_ (damping a) l * v l j)).
      set (s3 := sum n (fun l => at_ (plant a) l * placed h (X t) l j)) in *. set (s4 := sum n (fun l => at_ (plant a) l * z ^ (n - l) * v l j)) in *.
      transitivity (- (e ^ n * z ^ i) * (s1 + s2) - z ^ i * s3); [ring|]. rewrite P3, P2. ring. }
    rewrite C. rewrite (sum_ext n (fun l => (at_ (damping a) l + at_ (plant a) l * z ^ (n - l)) * v l j)
      (fun l => at_ (damping a) l * v l j + at_ (plant a) l * z ^ (n - l) * v l j)) by (intros; ring).
    rewrite sum_plus. ring.
  - rewrite (sum_at n (S i) (fun l => v l j)) by lia.
    assert (C : X t (S i) j * z ^ i = e * v (S i) j).
    { assert (P1 : X t (S i) j = placed h (X t) (S i) j) by (unfold placed; simpl; ring).
      rewrite P1, (y_times (X t) t (S i) j) by lra. fold e v. rewrite <- tech_pow_Rmult.
      transitivity (e * v (S i) j * (z ^ i * e ^ i)); [ring|]. rewrite Z1. ring. }
    rewrite C. ring.
Qed.

(** a function of all derivatives that falls at every instant *)
Variables (f : func) (r : R).
Hypothesis Hder : forall (X Z : R -> nat -> R) (dX dZ : nat -> R) (t : R), (forall j, (j < N)%nat -> is_derive (fun u : R => X u j) t (dX j)) ->
  (forall j, (j < N)%nat -> is_derive (fun u : R => Z u j) t (dZ j)) ->
  is_derive (fun u => pair es (ly f) (X u) (Z u)) t (pair es (ly f) dX (Z t) + pair es (ly f) (X t) dZ).
Hypothesis Hcont : forall (X Z : R -> nat -> R) (t : R), (forall j, (j < N)%nat -> continuous (fun u : R => X u j) t) ->
  (forall j, (j < N)%nat -> continuous (fun u : R => Z u j) t) -> continuous (fun u => pair es (ly f) (X u) (Z u)) t.
Hypothesis Hpos : positive (pair es (ly f)).
Let p i j := at_ (nth i (P a) []) j.
Hypothesis Hfall : forall t (v : nat -> nat -> R), 0 < t < T ->
  let m := moving (lap es) n (entry_at (zeta t) (theta a t)) K v in
  sum n (fun i => sum n (fun j => p i j * (pair es (ly f) (m i) (v j) + pair es (ly f) (v i) (m j))))
    <= - r * sum n (fun i => sum n (fun j => p i j * pair es (ly f) (v i) (v j))).
Lemma value_derive t : 0 < t < T -> t <> corner a -> is_derive (fun u => value a f (Y u)) t (eta a t * let m := moving (lap es) n (entry_at (zeta t) (theta a t)) K (Y t) in
  sum n (fun i => sum n (fun j => p i j * (pair es (ly f) (m i) (Y t j) + pair es (ly f) (Y t i) (m j))))).
Proof.
  intros Ht Hcorner. cbv zeta. set (m := moving (lap es) n (entry_at (zeta t) (theta a t)) K (Y t)). unfold value, double. fold n es. rewrite <- sum_scal.
  apply (is_derive_sum n (fun u i => sum n (fun j => at_ (nth i (P a) []) j * pair es (ly f) (Y u i) (Y u j)))). intros i Hi. rewrite <- sum_scal.
  apply (is_derive_sum n (fun u j => at_ (nth i (P a) []) j * pair es (ly f) (Y u i) (Y u j))). intros j Hj.
  evar_last.
  - apply is_derive_scal. apply (Hder (fun u => Y u i) (fun u => Y u j)); intros l Hl; apply Y_derive; assumption.
  - fold m. change (at_ (nth i (P a) []) j) with (p i j).
    rewrite (scales _ Hpos (eta a t) (m i)), (swaps _ Hpos (Y t i) (fun l => eta a t * _)), (scales _ Hpos (eta a t) (m j)), (swaps _ Hpos (m j)). ring.
Qed.
Theorem value_falls t : 0 <= t < T -> value a f (y a h (X t) t) <= exp (- (r * turns a t)) * value a f (y a h (X 0) 0).
Proof.
  intros Ht. rewrite <- !Y_eq by lra.
  assert (D : exp (r * turns a t) * value a f (Y t) <= exp (r * turns a 0) * value a f (Y 0)).
  { set (dv t := eta a t * let m := moving (lap es) n (entry_at (zeta t) (theta a t)) K (Y t) in
      sum n (fun i => sum n (fun j => p i j * (pair es (ly f) (m i) (Y t j) + pair es (ly f) (Y t i) (m j))))).
    apply (FamilyFlow.falls (fun t => exp (r * turns a t) * value a f (Y t)) 0 T (fun _ => corner a)); [| |exact Ht]; clear t Ht; intros t Ht;
      [|intros Hc; exists (r * eta a t * exp (r * turns a t) * value a f (Y t) + exp (r * turns a t) * dv t); split].
    - apply (continuous_mult (fun t => exp (r * turns a t)) (fun t => value a f (Y t))).
      + apply @ex_derive_continuous. eexists. apply is_derive_comp; [apply is_derive_exp|]. apply is_derive_scal. apply (turns_derive a Hprot). apply Ht.
      + unfold value, double. apply (continuous_sum n (fun u i => sum n (fun j => at_ (nth i (P a) []) j * pair es (ly f) (Y u i) (Y u j)))). intros i Hi.
        apply (continuous_sum n (fun u j => at_ (nth i (P a) []) j * pair es (ly f) (Y u i) (Y u j))). intros j Hj.
        apply (continuous_mult (fun _ => at_ (nth i (P a) []) j)); [apply continuous_const|].
        apply (Hcont (fun u => Y u i) (fun u => Y u j)); intros l Hl; apply Y_continuous; first [assumption|lra].
    - apply (is_derive_mult (fun t => exp (r * turns a t)) (fun t => value a f (Y t))).
      + evar_last. { apply is_derive_comp; [apply is_derive_exp|]. apply is_derive_scal. apply (turns_derive a Hprot). apply Ht. }
        unfold scal; simpl; unfold mult; simpl. ring.
      + apply value_derive; [exact Ht|exact (Hc O)].
      + intros; apply Rmult_comm.
    - pose proof (Hfall t (Y t) ltac:(lra)) as B. cbv zeta in B. fold K in B. pose proof (eta_pos t ltac:(lra)) as E. pose proof (exp_pos (r * turns a t)) as X0.
      unfold dv. cbv zeta. match type of B with ?q <= _ => change (q <= - r * value a f (Y t)) in B; set (q' := q) in * end.
      assert (0 <= exp (r * turns a t) * eta a t) by nra. nra. }
  rewrite (turns_0 a), Rmult_0_r, exp_0, Rmult_1_l in D.
  apply (Rmult_le_reg_l (exp (r * turns a t))); [apply exp_pos|]. rewrite <- Rmult_assoc, <- exp_plus.
  replace (r * turns a t + - (r * turns a t)) with 0 by ring. rewrite exp_0. lra.
Qed.
End Curve.
