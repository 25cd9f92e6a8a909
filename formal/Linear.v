(** Linear equations have solutions: Y' = - g(t) A (Y + S) for every continuous S, by the power series of e^{-A s}. *)
Require Import List Reals Lra Lia.
From Coquelicot Require Import Coquelicot.
Open Scope R_scope.

(** * Finite sums *)
Fixpoint sum (n : nat) (f : nat -> R) : R := match n with O => 0 | S p => sum p f + f p end.
Lemma sum_ext n f g : (forall i, (i < n)%nat -> f i = g i) -> sum n f = sum n g.
Proof. induction n as [|n IH]; intros H; simpl; [reflexivity|]. rewrite IH, H by auto. reflexivity. Qed.
Lemma sum_plus n f g : sum n (fun i => f i + g i) = sum n f + sum n g.
Proof. induction n as [|n IH]; simpl; [ring|]. rewrite IH. ring. Qed.
Lemma sum_scal n c f : sum n (fun i => c * f i) = c * sum n f.
Proof. induction n as [|n IH]; simpl; [ring|]. rewrite IH. ring. Qed.
Lemma sum_zero n f : (forall i, (i < n)%nat -> f i = 0) -> sum n f = 0.
Proof. intros H. rewrite (sum_ext n f (fun i => 0 * f i)), sum_scal; [ring|]. intros i Hi. rewrite H by assumption. ring. Qed.
Lemma sum_swap n f : forall p, sum n (fun i => sum p (fun j => f i j)) = sum p (fun j => sum n (fun i => f i j)).
Proof. induction n as [|n IH]; intros p; simpl; [symmetry; apply sum_zero; reflexivity|]. rewrite IH, <- sum_plus. reflexivity. Qed.
Lemma sum_one n f j : (j < n)%nat -> sum n (fun i => (if (i =? j)%nat then 1 else 0) * f i) = f j.
Proof.
  induction n as [|n IH]; intros H; [lia|]. simpl. destruct (Nat.eqb_spec n j) as [<-|N].
  - rewrite sum_zero; [ring|]. intros i Hi. destruct (Nat.eqb_spec i n); [lia|ring].
  - rewrite IH by lia. ring.
Qed.
Lemma sum_le n f g : (forall i, (i < n)%nat -> f i <= g i) -> sum n f <= sum n g.
Proof. induction n as [|n IH]; intros H; simpl; [lra|]. apply Rplus_le_compat; auto. Qed.
Lemma sum_abs n f : Rabs (sum n f) <= sum n (fun i => Rabs (f i)).
Proof.
  induction n as [|n IH]; simpl; [rewrite Rabs_R0; lra|]. eapply Rle_trans; [apply Rabs_triang|]. apply Rplus_le_compat_r. exact IH.
Qed.
Lemma sum_derive n (f : nat -> R -> R) df t : (forall i, (i < n)%nat -> is_derive (f i) t (df i)) ->
  is_derive (fun u => sum n (fun i => f i u)) t (sum n df).
Proof.
  induction n as [|n IH]; intros H; simpl; [apply @is_derive_const|].
  apply (is_derive_plus (fun u => sum n (fun i => f i u)) (f n)); auto.
Qed.
Lemma sum_continuous n (f : nat -> R -> R) t : (forall i, (i < n)%nat -> continuous (f i) t) ->
  continuous (fun u => sum n (fun i => f i u)) t.
Proof.
  induction n as [|n IH]; intros H; simpl; [apply continuous_const|].
  apply (continuous_plus (fun u => sum n (fun i => f i u)) (f n)); auto.
Qed.
Lemma is_derive_times (f g : R -> R) t df dg :
  is_derive f t df -> is_derive g t dg -> is_derive (fun u => f u * g u) t (df * g t + f t * dg).
Proof. intros F G. apply (is_derive_mult f g t df dg F G). intros; apply Rmult_comm. Qed.
Lemma is_derive_after (f g : R -> R) t df dg : is_derive f (g t) df -> is_derive g t dg ->
  is_derive (fun u => f (g u)) t (dg * df).
Proof. intros F G. apply (is_derive_comp f g t df dg F G). Qed.
Lemma continuous_times (f g : R -> R) t : continuous f t -> continuous g t -> continuous (fun u => f u * g u) t.
Proof. apply (continuous_mult f g). Qed.
(** the integral of a continuous function *)
Lemma primitive (f : R -> R) T : 0 < T -> (forall t, t < T -> continuous f t) ->
  forall t, t < T -> is_derive (fun u => RInt f 0 u) t (f t).
Proof.
  intros HT C t Ht. apply (is_derive_RInt f _ 0); [|apply C; exact Ht]. assert (He : 0 < T - t) by lra.
  exists (mkposreal _ He). intros u Hu. change (Rabs (u - t) < T - t) in Hu. apply Rabs_def2 in Hu.
  apply (@RInt_correct R_CompleteNormedModule). apply (@ex_RInt_continuous R_CompleteNormedModule). intros z Hz. apply C.
  pose proof (Rmax_lub_lt 0 u T HT ltac:(lra)). lra.
Qed.

(** * The exponential *)
Section Exponential.
Variables (n : nat) (m : nat -> nat -> R).
(** [(-m)^k / k!] *)
Fixpoint coeff k i j := match k with O => if (i =? j)%nat then 1 else 0
  | S q => sum n (fun l => m i l * coeff q l j) * - / INR (S q) end.
Definition expm (x : R) i j := PSeries (fun k => coeff k i j) x.
Definition times (a b : nat -> nat -> R) i j := sum n (fun l => a i l * b l j).

Lemma times_assoc a b c i j : times (times a b) c i j = times a (times b c) i j.
Proof.
  unfold times. rewrite (sum_ext n _ (fun l => sum n (fun q => a i q * b q l * c l j))).
  2: { intros l _. rewrite Rmult_comm, <- sum_scal. apply sum_ext. intros. ring. }
  rewrite sum_swap. apply sum_ext. intros q _. rewrite <- sum_scal. apply sum_ext. intros. ring.
Qed.
Lemma times_ext a b c d i j : (forall l, (l < n)%nat -> a i l = c i l) -> (forall l, (l < n)%nat -> b l j = d l j) ->
  times a b i j = times c d i j.
Proof. intros H K. apply sum_ext. intros l Hl. rewrite H, K by exact Hl. reflexivity. Qed.
Lemma times_scal_l a b x i j : times (fun i j => a i j * x) b i j = times a b i j * x.
Proof. unfold times. rewrite Rmult_comm, <- sum_scal. apply sum_ext. intros. ring. Qed.
Lemma times_scal_r a b x i j : times a (fun i j => b i j * x) i j = times a b i j * x.
Proof. unfold times. rewrite Rmult_comm, <- sum_scal. apply sum_ext. intros. ring. Qed.
Lemma coeff_commutes k : forall i j, (i < n)%nat -> (j < n)%nat -> times (coeff k) m i j = times m (coeff k) i j.
Proof.
  induction k as [|k IH]; intros i j Hi Hj.
  - unfold times. simpl. rewrite (sum_ext n _ (fun l => (if (l =? i)%nat then 1 else 0) * m l j)).
    2: { intros l _. destruct (Nat.eqb_spec i l), (Nat.eqb_spec l i); try congruence; subst; ring. }
    rewrite (sum_ext n (fun l => m i l * _) (fun l => (if (l =? j)%nat then 1 else 0) * m i l)) by (intros; ring).
    rewrite !sum_one by assumption. reflexivity.
  - change (coeff (S k)) with (fun i j => times m (coeff k) i j * - / INR (S k)).
    rewrite times_scal_l, times_scal_r. f_equal. rewrite times_assoc. apply times_ext; [reflexivity|]. auto.
Qed.

(** the largest sum of a row is below this *)
Let M := sum n (fun i => sum n (fun l => Rabs (m i l))).
Lemma sum_nonneg p f : (forall i, (i < p)%nat -> 0 <= f i) -> 0 <= sum p f.
Proof. intros H. rewrite <- (sum_zero p (fun _ => 0)) by reflexivity. apply sum_le. exact H. Qed.
Lemma sum_entry p f i : (forall l, (l < p)%nat -> 0 <= f l) -> (i < p)%nat -> f i <= sum p f.
Proof.
  induction p as [|p IH]; intros H Hi; [lia|]. simpl. pose proof (sum_nonneg p f ltac:(auto)). pose proof (H p ltac:(lia)).
  destruct (Nat.eq_dec i p) as [->|N]; [lra|]. specialize (IH ltac:(auto) ltac:(lia)). lra.
Qed.
Lemma coeff_small k : forall i j, (i < n)%nat -> Rabs (coeff k i j) <= M ^ k / INR (fact k).
Proof.
  assert (A : forall i, 0 <= sum n (fun l => Rabs (m i l))) by (intros; apply sum_nonneg; intros; apply Rabs_pos).
  assert (M0 : 0 <= M) by (apply sum_nonneg; intros; apply A).
  induction k as [|k IH]; intros i j Hi.
  - simpl. destruct (i =? j)%nat; rewrite ?Rabs_R1, ?Rabs_R0; lra.
  - cbn [coeff]. rewrite Rabs_mult, Rabs_Ropp. pose proof (lt_0_INR (S k) ltac:(lia)) as K. pose proof (INR_fact_lt_0 k) as F.
    rewrite (Rabs_right (/ INR (S k))) by (apply Rle_ge; left; apply Rinv_0_lt_compat; exact K).
    replace (M ^ S k / INR (fact (S k))) with (M * (M ^ k / INR (fact k)) * / INR (S k))
      by (rewrite fact_simpl, mult_INR; cbn [pow]; field; split; lra).
    apply Rmult_le_compat_r; [left; apply Rinv_0_lt_compat; exact K|]. eapply Rle_trans; [apply sum_abs|].
    apply Rle_trans with (sum n (fun l => Rabs (m i l)) * (M ^ k / INR (fact k))).
    + rewrite Rmult_comm, <- sum_scal. apply sum_le. intros l Hl. rewrite Rabs_mult, Rmult_comm.
      apply Rmult_le_compat_r; [apply Rabs_pos|]. apply IH. exact Hl.
    + apply Rmult_le_compat_r; [apply Rmult_le_pos; [apply pow_le; exact M0|left; apply Rinv_0_lt_compat; exact F]|].
      apply (sum_entry n (fun i => sum n (fun l => Rabs (m i l)))); auto.
Qed.
Lemma exp_terms x : exists B, forall k, Rabs (x ^ k / INR (fact k)) <= B.
Proof.
  assert (H : ex_series (fun k => x ^ k / INR (fact k))).
  { exists (exp x). apply (is_series_ext (fun k => scal (pow_n x k) (/ INR (fact k)))); [|apply is_exp_Reals].
    intros k. rewrite pow_n_pow. reflexivity. }
  apply ex_series_lim_0 in H. destruct (filterlim_bounded _ (ex_intro _ 0 H)) as [B HB]. exists B. exact HB.
Qed.
Lemma radius i j : (i < n)%nat -> CV_radius (fun k => coeff k i j) = p_infty.
Proof.
  intros Hi. apply Rbar_le_antisym; [destruct (CV_radius _); exact I|]. destruct (CV_radius_bounded (fun k => coeff k i j)) as [U _].
  assert (A : forall r : R, Rbar_le r (CV_radius (fun k => coeff k i j))).
  { intros r. apply U. destruct (exp_terms (M * r)) as [B HB]. exists B. intros k. eapply Rle_trans; [|apply HB].
    replace ((M * r) ^ k / INR (fact k)) with (M ^ k / INR (fact k) * r ^ k) by (rewrite Rpow_mult_distr; field; apply INR_fact_neq_0).
    rewrite !(Rabs_mult _ (r ^ k)). apply Rmult_le_compat_r; [apply Rabs_pos|]. eapply Rle_trans; [apply coeff_small; exact Hi|]. apply Rle_abs. }
  destruct (CV_radius (fun k => coeff k i j)) as [r| |] eqn:E; [|exact I|exact (A 0)]. specialize (A (r + 1)). simpl in A. lra.
Qed.
Lemma converges i j x : (i < n)%nat -> ex_pseries (fun k => coeff k i j) x.
Proof. intros Hi. apply CV_radius_inside. rewrite radius by exact Hi. exact I. Qed.
Lemma series_sum (a : nat -> nat -> R) (w : nat -> R) x p : (forall l, (l < p)%nat -> ex_pseries (a l) x) ->
  ex_pseries (fun k => sum p (fun l => w l * a l k)) x /\
  PSeries (fun k => sum p (fun l => w l * a l k)) x = sum p (fun l => w l * PSeries (a l) x).
Proof.
  induction p as [|p IH]; intros H; simpl.
  - split.
    + apply CV_radius_inside. rewrite (CV_radius_const_0 : CV_radius (fun _ => 0) = p_infty). exact I.
    + apply PSeries_const_0.
  - destruct IH as [A B]; [auto|]. assert (C : ex_pseries (PS_scal (w p) (a p)) x) by (apply ex_pseries_scal; [apply Rmult_comm|auto]).
    split; [exact (ex_pseries_plus _ _ x A C)|]. rewrite <- B, <- PSeries_scal. apply (PSeries_plus _ _ x A C).
Qed.
Lemma expm_derive x i j : (i < n)%nat -> is_derive (fun u => expm u i j) x (- times m (expm x) i j).
Proof.
  intros Hi. evar_last; [apply is_derive_PSeries; rewrite radius by exact Hi; exact I|].
  destruct (series_sum (fun l k => coeff k l j) (m i) x n) as [_ E]; [intros; apply converges; assumption|].
  unfold times, expm. rewrite <- E. replace (- _) with (-1 * PSeries (fun k => sum n (fun l => m i l * coeff k l j)) x) by ring.
  rewrite <- PSeries_scal. apply PSeries_ext. intros k. unfold PS_derive, PS_scal, scal; cbn [coeff]. simpl; unfold mult; simpl.
  field. apply (not_0_INR (S k)). lia.
Qed.
Lemma expm_0 i j : expm 0 i j = if (i =? j)%nat then 1 else 0.
Proof. apply PSeries_0. Qed.
Lemma expm_commutes x i j : (i < n)%nat -> (j < n)%nat -> times (expm x) m i j = times m (expm x) i j.
Proof.
  intros Hi Hj. unfold times, expm.
  rewrite <- (proj2 (series_sum (fun l k => coeff k l j) (m i) x n (fun l Hl => converges l j x Hl))).
  rewrite (sum_ext n _ (fun l => m l j * PSeries (fun k => coeff k i l) x)) by (intros; ring).
  rewrite <- (proj2 (series_sum (fun l k => coeff k i l) (fun l => m l j) x n (fun l _ => converges i l x Hi))).
  apply PSeries_ext. intros k. etransitivity; [|exact (coeff_commutes k i j Hi Hj)]. apply sum_ext. intros; ring.
Qed.
(** [e^{-m x} e^{m x} = 1] *)
Lemma expm_inverse x i j : (i < n)%nat -> (j < n)%nat -> times (expm x) (expm (- x)) i j = if (i =? j)%nat then 1 else 0.
Proof.
  intros Hi Hj. assert (D : forall u, is_derive (fun u => times (expm u) (expm (- u)) i j) u 0).
  { intros u. evar_last.
    - apply (sum_derive n (fun l u => expm u i l * expm (- u) l j)). intros l Hl.
      apply is_derive_times; [apply expm_derive; exact Hi|].
      apply (is_derive_after (fun v => expm v l j) Ropp u (- times m (expm (- u)) l j) (-1)); [apply expm_derive; exact Hl|].
      auto_derive; [exact I|ring].
    - rewrite sum_plus. rewrite (sum_ext n (fun l => expm u i l * _) (fun l => expm u i l * times m (expm (- u)) l j)) by (intros; ring).
      rewrite (sum_ext n _ (fun l => -1 * (times m (expm u) i l * expm (- u) l j))) by (intros; ring). rewrite sum_scal.
      change (-1 * times (times m (expm u)) (expm (- u)) i j + times (expm u) (times m (expm (- u))) i j = 0).
      rewrite <- times_assoc. rewrite (times_ext (times m (expm u)) _ (times (expm u) m) (expm (- u))); [ring| |reflexivity].
      intros l Hl. symmetry. apply expm_commutes; assumption. }
  assert (C : times (expm x) (expm (- x)) i j = times (expm 0) (expm (- 0)) i j).
  { destruct (MVT_gen (fun u => times (expm u) (expm (- u)) i j) 0 x (fun _ => 0)) as [z [_ E]]; [intros; apply D| |lra].
    intros u _. apply continuity_pt_filterlim. apply @ex_derive_continuous. exists 0. apply D. }
  rewrite C, Ropp_0. unfold times. rewrite (sum_ext n _ (fun l => (if (l =? i)%nat then 1 else 0) * expm 0 l j)).
  2: { intros l _. rewrite (expm_0 i l). destruct (Nat.eqb_spec i l), (Nat.eqb_spec l i); try congruence; reflexivity. }
  rewrite sum_one by exact Hi. apply expm_0.
Qed.

(** * The equation, in a clock [s] whose derivative is [g] *)
Variables (T : R) (s g : R -> R) (S : R -> nat -> R) (x0 : nat -> R).
Hypotheses (HT : 0 < T) (Hs : s 0 = 0) (Hg : forall t, t < T -> is_derive s t (g t)) (Cg : forall t, t < T -> continuous g t).
Hypothesis CS : forall t i, t < T -> (i < n)%nat -> continuous (fun u => S u i) t.
Definition force t i := - (g t * sum n (fun j => m i j * S t j)).
Definition back t i := sum n (fun j => expm (- s t) i j * force t j).
Definition solution t i := sum n (fun j => expm (s t) i j * (x0 j + RInt (fun r => back r j) 0 t)).
Lemma back_continuous t i : t < T -> (i < n)%nat -> continuous (fun u => back u i) t.
Proof.
  intros Ht Hi. apply (sum_continuous n (fun j u => expm (- s u) i j * force u j)). intros j Hj. apply continuous_times.
  - apply @ex_derive_continuous. eexists. apply (is_derive_after (fun v => expm v i j) (fun u => - s u)); [apply expm_derive; exact Hi|].
    apply @is_derive_opp. apply Hg. exact Ht.
  - apply (continuous_opp (fun u => g u * sum n (fun l => m j l * S u l))). apply continuous_times; [apply Cg; exact Ht|].
    apply (sum_continuous n (fun l u => m j l * S u l)). intros l Hl. apply continuous_times; [apply continuous_const|apply CS; assumption].
Qed.
Lemma solution_0 i : (i < n)%nat -> solution 0 i = x0 i.
Proof.
  intros Hi. unfold solution. rewrite Hs. rewrite (sum_ext n _ (fun j => (if (j =? i)%nat then 1 else 0) * x0 j)).
  - apply sum_one. exact Hi.
  - intros j _. rewrite expm_0, RInt_point. unfold zero; simpl.
    destruct (Nat.eqb_spec i j), (Nat.eqb_spec j i); try congruence; ring.
Qed.
Lemma solution_derive t i : t < T -> (i < n)%nat ->
  is_derive (fun u => solution u i) t (- (g t * sum n (fun j => m i j * (solution t j + S t j)))).
Proof.
  intros Ht Hi. set (c := fun u j => x0 j + RInt (fun r => back r j) 0 u). evar_last.
  - apply (sum_derive n (fun j u => expm (s u) i j * c u j)). intros j Hj. apply is_derive_times.
    + apply (is_derive_after (fun v => expm v i j) s); [apply expm_derive; exact Hi|apply Hg; exact Ht].
    + unfold c. evar_last; [apply @is_derive_plus; [apply @is_derive_const|]|apply Rplus_0_l].
      apply (primitive (fun r => back r j) T HT); [|exact Ht]. intros r Hr. apply back_continuous; assumption.
  - rewrite sum_plus.
    assert (A : sum n (fun l => expm (s t) i l * back t l) = force t i).
    { change (times (expm (s t)) (fun l _ => back t l) i O = force t i). unfold back.
      change (times (expm (s t)) (times (expm (- s t)) (fun j _ => force t j)) i O = force t i). rewrite <- times_assoc.
      rewrite (times_ext _ (fun j _ => force t j) (fun i j => if (j =? i)%nat then 1 else 0) (fun j _ => force t j)); [|
        intros l Hl; rewrite expm_inverse by assumption;
        destruct (Nat.eqb_spec i l), (Nat.eqb_spec l i); try congruence; reflexivity|reflexivity].
      unfold times. apply (sum_one n (fun j => force t j)). exact Hi. }
    rewrite A. unfold force. rewrite (sum_ext n _ (fun l => (- g t) * (times m (expm (s t)) i l * c t l))) by (intros; ring).
    rewrite sum_scal. change (sum n (fun l => times m (expm (s t)) i l * c t l)) with (times (times m (expm (s t))) (fun l _ => c t l) i O).
    rewrite times_assoc. change (times (expm (s t)) (fun l _ => c t l)) with (fun j (_ : nat) => solution t j). unfold times.
    rewrite (sum_ext n (fun j => m i j * (solution t j + S t j)) (fun j => m i j * solution t j + m i j * S t j)) by (intros; ring).
    rewrite sum_plus. ring.
Qed.
End Exponential.
