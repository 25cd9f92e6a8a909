(** Equations [x' = f(t, x)] have solutions on [0, T) from every state: [f] is Lipschitz in [x], and of [t] it is asked
    only that [f] is bounded; the equation holds where [f] is continuous in [t]. *)
Require Import List Reals Lra Lia.
From Coquelicot Require Import Coquelicot.
Open Scope R_scope.

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

(** * The upper integral: the least integral of what is above a function. All bounded functions have it. *)
Definition over (f : R -> R) t (I : R) := exists g, is_RInt g 0 t I /\ forall u, 0 <= u <= t -> f u <= g u.
Definition upper (f : R -> R) t : R := real (Glb_Rbar (over f t)).
Definition within_ (M t : R) (f : R -> R) := forall u, 0 <= u <= t -> Rabs (f u) <= M.
Lemma over_const f M t : within_ M t f -> over f t (M * t).
Proof.
  intros B. exists (fun _ => M). split; [|intros u Hu; specialize (B u Hu); apply Rabs_le_between in B; lra].
  replace (M * t) with (scal (t - 0) M) by (unfold scal; simpl; unfold mult; simpl; ring). apply @is_RInt_const.
Qed.
Lemma below_over f M t I : 0 <= t -> within_ M t f -> over f t I -> - (M * t) <= I.
Proof.
  intros Ht B [g [G H]]. replace (- (M * t)) with (scal (t - 0) (- M)) by (unfold scal; simpl; unfold mult; simpl; ring).
  apply (is_RInt_le (fun _ => - M) g 0 t); [exact Ht|apply @is_RInt_const|exact G|]. intros u Hu.
  specialize (B u ltac:(lra)). specialize (H u ltac:(lra)). apply Rabs_le_between in B. lra.
Qed.
Lemma upper_ok f M t : 0 <= t -> within_ M t f ->
  (forall I, over f t I -> upper f t <= I) /\ forall a, (forall I, over f t I -> a <= I) -> a <= upper f t.
Proof.
  intros Ht B. destruct (Glb_Rbar_correct (over f t)) as [L G]. unfold upper.
  assert (A : Rbar_le (- (M * t)) (Glb_Rbar (over f t))) by (apply G; intros I HI; apply (below_over f M t I Ht B HI)).
  pose proof (L _ (over_const f M t B)) as A2. destruct (Glb_Rbar (over f t)) as [r| |]; [|contradiction|contradiction].
  split; [exact L|]. intros a Ha. apply (G a). exact Ha.
Qed.
Lemma upper_0 f : upper f 0 = 0.
Proof.
  assert (B : within_ (Rabs (f 0)) 0 f) by (intros u Hu; replace u with 0 by lra; lra).
  destruct (upper_ok f _ 0 (Rle_refl 0) B) as [U1 U2]. apply Rle_antisym.
  - apply U1. exists f. split; [apply @is_RInt_point|intros; lra].
  - apply U2. intros I [g [G _]]. right. apply (is_RInt_unique g 0 0) in G. rewrite <- G. symmetry. apply @RInt_point.
Qed.
(** it grows as far as the function lets it *)
Lemma upper_step f M u v c1 c2 : 0 <= u <= v -> within_ M v f -> (forall s, u <= s <= v -> c1 <= f s <= c2) ->
  c1 * (v - u) <= upper f v - upper f u <= c2 * (v - u).
Proof.
  intros Huv B C. assert (Bu : within_ M u f) by (intros s Hs; apply B; lra).
  destruct (upper_ok f M u ltac:(lra) Bu) as [U1 U2]. destruct (upper_ok f M v ltac:(lra) B) as [V1 V2]. split.
  - assert (c1 * (v - u) + upper f u <= upper f v); [|lra]. apply V2. intros I [g [G H]].
    assert (E : ex_RInt g 0 v) by (exists I; exact G).
    pose proof (ex_RInt_Chasles_1 g 0 u v ltac:(lra) E) as E1. pose proof (ex_RInt_Chasles_2 g 0 u v ltac:(lra) E) as E2.
    apply (is_RInt_unique g 0 v) in G. rewrite <- G, <- (RInt_Chasles g 0 u v E1 E2).
    assert (upper f u <= RInt g 0 u).
    { apply U1. exists g. split; [apply (RInt_correct g); exact E1|]. intros s Hs. apply H. lra. }
    assert (c1 * (v - u) <= RInt g u v).
    { replace (c1 * (v - u)) with (RInt (fun _ => c1) u v) by (rewrite RInt_const; unfold scal; simpl; unfold mult; simpl; ring).
      apply RInt_le; [lra|apply ex_RInt_const|exact E2|]. intros s Hs. specialize (C s ltac:(lra)). specialize (H s ltac:(lra)). lra. }
    unfold plus; simpl. lra.
  - assert (upper f v - c2 * (v - u) <= upper f u); [|lra]. apply U2. intros I [g [G H]].
    assert (upper f v <= I + c2 * (v - u)); [|lra]. apply V1. exists (fun s => if Rle_dec s u then g s else c2). split.
    + apply (is_RInt_Chasles _ 0 u v I (c2 * (v - u))).
      * apply (is_RInt_ext g); [|exact G]. intros s Hs. rewrite Rmin_left, Rmax_right in Hs by lra. destruct (Rle_dec s u); lra.
      * apply (is_RInt_ext (fun _ => c2)).
        { intros s Hs. rewrite Rmin_left in Hs by lra. destruct (Rle_dec s u); lra. }
        replace (c2 * (v - u)) with (scal (v - u) c2) by (unfold scal; simpl; unfold mult; simpl; ring). apply @is_RInt_const.
    + intros s Hs. destruct (Rle_dec s u); [apply H; lra|apply C; lra].
Qed.
Lemma upper_compare f g e M N t I : 0 <= t -> within_ M t f -> within_ N t g -> (forall u, 0 <= u <= t -> f u <= g u + e u) ->
  is_RInt e 0 t I -> upper f t <= upper g t + I.
Proof.
  intros Ht BF BG H E. destruct (upper_ok f M t Ht BF) as [U _]. destruct (upper_ok g N t Ht BG) as [_ V].
  assert (upper f t - I <= upper g t); [|lra]. apply V. intros J [g' [G1 G2]]. assert (upper f t <= J + I); [|lra].
  apply U. exists (fun u => g' u + e u). split; [apply (is_RInt_plus g' e _ _ _ _ G1 E)|].
  intros u Hu. specialize (H u Hu). specialize (G2 u Hu). lra.
Qed.
Lemma upper_close f g e M N t I : 0 <= t -> within_ M t f -> within_ N t g -> (forall u, 0 <= u <= t -> Rabs (f u - g u) <= e u) ->
  is_RInt e 0 t I -> Rabs (upper f t - upper g t) <= I.
Proof.
  intros Ht BF BG H E.
  assert (A : forall u, 0 <= u <= t -> f u <= g u + e u) by (intros u Hu; specialize (H u Hu); apply Rabs_le_between in H; lra).
  assert (B : forall u, 0 <= u <= t -> g u <= f u + e u) by (intros u Hu; specialize (H u Hu); apply Rabs_le_between in H; lra).
  pose proof (upper_compare f g e M N t I Ht BF BG A E). pose proof (upper_compare g f e N M t I Ht BG BF B E). apply Rabs_le. lra.
Qed.
(** its derivative is the function, where that is continuous *)
Lemma upper_derive f T t : (forall v, 0 <= v < T -> exists M, within_ M v f) -> 0 < t < T -> continuous f t ->
  is_derive (upper f) t (f t).
Proof.
  intros B Ht C. apply is_derive_Reals. intros e He. unfold continuous in C. rewrite filterlim_locally in C.
  assert (He2 : 0 < e / 2) by lra. destruct (C (mkposreal _ He2)) as [d Hd].
  assert (D : forall s, Rabs (s - t) < d -> f t - e / 2 <= f s <= f t + e / 2).
  { intros s Hs. specialize (Hd s Hs). change (Rabs (f s - f t) < e / 2) in Hd. apply Rabs_def2 in Hd. lra. }
  assert (Hp : 0 < Rmin d (Rmin t (T - t))).
  { apply Rmin_pos; [apply cond_pos|]. apply Rmin_pos; lra. }
  exists (mkposreal _ Hp). intros h Hh0 Hh. simpl in Hh. pose proof (Rmin_l d (Rmin t (T - t))). pose proof (Rmin_r d (Rmin t (T - t))).
  pose proof (Rmin_l t (T - t)). pose proof (Rmin_r t (T - t)). apply Rabs_def2 in Hh.
  apply Rle_lt_trans with (e / 2); [|lra]. destruct (Rlt_le_dec 0 h) as [L|L].
  - destruct (B (t + h) ltac:(lra)) as [M HM].
    destruct (upper_step f M t (t + h) _ _ ltac:(lra) HM (fun s Hs => D s ltac:(apply Rabs_def1; lra))) as [K1 K2].
    replace (t + h - t) with h in K1, K2 by ring. set (q := upper f (t + h) - upper f t) in *.
    replace q with (q / h * h) in K1, K2 by (field; lra). apply Rmult_le_reg_r in K1, K2; try exact L. apply Rabs_le. lra.
  - destruct (B t ltac:(lra)) as [M HM].
    destruct (upper_step f M (t + h) t _ _ ltac:(lra) HM (fun s Hs => D s ltac:(apply Rabs_def1; lra))) as [K1 K2].
    replace (t - (t + h)) with (- h) in K1, K2 by ring. set (q := upper f (t + h) - upper f t).
    replace (upper f t - upper f (t + h)) with (q / h * - h) in K1, K2 by (unfold q; field; exact Hh0).
    apply Rmult_le_reg_r in K1, K2; try lra. apply Rabs_le. lra.
Qed.

(** * The equation *)
Lemma vanishes a c : 0 <= a -> (forall k, a <= c * (/ 2) ^ k) -> a = 0.
Proof.
  intros A H. apply Rle_antisym; [|exact A]. apply Rnot_lt_le. intros P.
  assert (C : 0 < c) by (specialize (H O); simpl in H; lra).
  destruct (pow_lt_1_zero (/ 2) ltac:(rewrite Rabs_right; lra) (a / c) ltac:(apply Rdiv_lt_0_compat; assumption)) as [N HN].
  specialize (HN N (Nat.le_refl N)). specialize (H N). apply Rabs_def2 in HN as [HN _].
  apply (Rmult_lt_compat_l c) in HN; [|exact C]. replace (c * (a / c)) with a in HN by (field; lra). lra.
Qed.
Section Equation.
Variables (I : Type) (T : R) (f : R -> (I -> R) -> I -> R) (x0 : I -> R).
Hypothesis HT : 0 < T.
Hypothesis Hf : forall v, 0 <= v < T -> exists M, 0 <= M /\ forall t i, 0 <= t <= v -> Rabs (f t x0 i) <= M /\
  forall x z d, (forall j, Rabs (x j - z j) <= d) -> Rabs (f t x i - f t z i) <= M * d.
Fixpoint iterate k (t : R) (i : I) : R := match k with O => x0 i | S q => x0 i + upper (fun u => f u (iterate q u) i) t end.
Definition solution t i : R := Lim_seq (fun k => iterate k t i).

Section Until.
Variables (v M : R).
Hypotheses (Hv : 0 <= v < T) (HM : 0 <= M).
Hypothesis HB : forall t i, 0 <= t <= v -> Rabs (f t x0 i) <= M /\
  forall x z d, (forall j, Rabs (x j - z j) <= d) -> Rabs (f t x i - f t z i) <= M * d.
Let E t := exp (2 * M * t).
Lemma E_grows t u : t <= u -> E t <= E u.
Proof.
  intros H. assert (L : 2 * M * t <= 2 * M * u) by (apply Rmult_le_compat_l; lra).
  destruct L as [L|L]; unfold E; [left; apply exp_increasing; exact L|rewrite L; lra].
Qed.
Lemma E_1 t : 0 <= t -> 1 <= E t.
Proof. intros Ht. replace 1 with (E 0) by (unfold E; rewrite Rmult_0_r; apply exp_0). apply E_grows. exact Ht. Qed.
Lemma E_le t : t <= v -> E t <= E v.
Proof. apply E_grows. Qed.
Lemma E_integral c t : is_RInt (fun u => M * c * E u) 0 t (c / 2 * (E t - 1)).
Proof.
  replace (c / 2 * (E t - 1)) with (minus (c / 2 * E t) (c / 2 * E 0))
    by (unfold minus, plus, opp, E; simpl; rewrite Rmult_0_r, exp_0; ring).
  apply (is_RInt_derive (fun u => c / 2 * E u)).
  - intros u _. unfold E. auto_derive; [exact Logic.I|field].
  - intros u _. apply @ex_derive_continuous. unfold E. auto_derive. exact Logic.I.
Qed.
Lemma right_side (y : I -> R) d u i : 0 <= u <= v -> (forall j, Rabs (y j - x0 j) <= d) -> Rabs (f u y i) <= M + M * d.
Proof.
  intros Hu D. destruct (HB u i Hu) as [B0 B1]. specialize (B1 y x0 d D).
  replace (f u y i) with (f u x0 i + (f u y i - f u x0 i)) by ring. eapply Rle_trans; [apply Rabs_triang|]. lra.
Qed.
(** half of what parts two curves parts what is made of them *)
Lemma closer (x z : R -> I -> R) c K : 0 <= c -> (forall t i, 0 <= t <= v -> Rabs (x t i - x0 i) <= K) ->
  (forall t i, 0 <= t <= v -> Rabs (z t i - x0 i) <= K) -> (forall t i, 0 <= t <= v -> Rabs (x t i - z t i) <= c * E t) ->
  forall t i, 0 <= t <= v -> Rabs (upper (fun u => f u (x u) i) t - upper (fun u => f u (z u) i) t) <= c / 2 * E t.
Proof.
  intros Hc Bx Bz D t i Ht.
  assert (B : forall y : R -> I -> R, (forall t i, 0 <= t <= v -> Rabs (y t i - x0 i) <= K) ->
    within_ (M + M * K) t (fun u => f u (y u) i)).
  { intros y By u Hu. apply right_side; [lra|]. intros j. apply By. lra. }
  assert (A : forall u, 0 <= u <= t -> Rabs (f u (x u) i - f u (z u) i) <= M * c * E u).
  { intros u Hu. rewrite Rmult_assoc. apply HB; [lra|]. intros j. apply D. lra. }
  pose proof (upper_close _ _ _ _ _ t _ (proj1 Ht) (B x Bx) (B z Bz) A (E_integral c t)).
  assert (c / 2 * (E t - 1) <= c / 2 * E t) by (apply Rmult_le_compat_l; lra). lra.
Qed.
Lemma iterate_near k : forall t i, 0 <= t <= v -> Rabs (iterate k t i - x0 i) <= E t.
Proof.
  induction k as [|k IH]; intros t i Ht; cbn [iterate].
  - rewrite Rminus_eq_0, Rabs_R0. pose proof (E_1 t (proj1 Ht)). lra.
  - assert (W : within_ (M + M * E v) t (fun u => f u (iterate k u) i) /\
      forall u, 0 <= u <= t -> Rabs (f u (iterate k u) i - 0) <= M * 2 * E u).
    { assert (A : forall u, 0 <= u <= t -> Rabs (f u (iterate k u) i) <= M + M * E u).
      { intros u Hu. apply right_side; [lra|]. intros j. apply IH. lra. }
      split; intros u Hu; rewrite ?Rminus_0_r; (eapply Rle_trans; [apply A; exact Hu|]).
      - apply Rplus_le_compat_l, Rmult_le_compat_l; [exact HM|]. apply E_le. lra.
      - pose proof (Rmult_le_compat_l M _ _ HM (E_1 u (proj1 Hu))). lra. }
    destruct W as [W A]. assert (Z : within_ 0 t (fun _ => 0)) by (intros u _; rewrite Rabs_R0; lra).
    assert (U0 : upper (fun _ => 0) t = 0).
    { pose proof (upper_step (fun _ => 0) 0 0 t 0 0 ltac:(lra) Z ltac:(intros; lra)). rewrite upper_0 in H. lra. }
    pose proof (upper_close _ (fun _ => 0) _ _ _ t _ (proj1 Ht) W Z A (E_integral 2 t)) as H. rewrite U0, Rminus_0_r in H.
    replace (x0 i + _ - x0 i) with (upper (fun u => f u (iterate k u) i) t) by ring. lra.
Qed.
Lemma near_v k t i : 0 <= t <= v -> Rabs (iterate k t i - x0 i) <= E v.
Proof. intros Ht. eapply Rle_trans; [apply iterate_near; exact Ht|apply E_le; lra]. Qed.
Lemma iterate_step k : forall t i, 0 <= t <= v -> Rabs (iterate (S k) t i - iterate k t i) <= (/ 2) ^ k * E t.
Proof.
  induction k as [|k IH]; intros t i Ht; [rewrite pow_O, Rmult_1_l; apply (iterate_near 1); exact Ht|].
  change (iterate (S (S k)) t i) with (x0 i + upper (fun u => f u (iterate (S k) u) i) t). cbn [iterate].
  replace (x0 i + _ - (x0 i + _)) with (upper (fun u => f u (iterate (S k) u) i) t - upper (fun u => f u (iterate k u) i) t)
    by (simpl; ring).
  replace ((/ 2) ^ S k * E t) with ((/ 2) ^ k / 2 * E t) by (simpl; field).
  apply (closer (iterate (S k)) (iterate k) _ (E v)); auto using near_v. apply pow_le. lra.
Qed.
Lemma iterate_tail k p t i : 0 <= t <= v -> Rabs (iterate (p + k) t i - iterate k t i) <= 2 * (/ 2) ^ k * E t.
Proof.
  intros Ht. assert (A : Rabs (iterate (p + k) t i - iterate k t i) <= 2 * ((/ 2) ^ k - (/ 2) ^ (p + k)) * E t).
  { induction p as [|p IH]; [rewrite Nat.add_0_l, !Rminus_eq_0, Rabs_R0; lra|]. pose proof (iterate_step (p + k) t i Ht) as H.
    replace (iterate (S p + k) t i - iterate k t i)
      with (iterate (S (p + k)) t i - iterate (p + k) t i + (iterate (p + k) t i - iterate k t i)) by (simpl; ring).
    eapply Rle_trans; [apply Rabs_triang|]. simpl Nat.add. rewrite <- (tech_pow_Rmult (/ 2) (p + k)). lra. }
  eapply Rle_trans; [exact A|]. apply Rmult_le_compat_r; [left; apply exp_pos|]. pose proof (pow_le (/ 2) (p + k) ltac:(lra)). lra.
Qed.
Lemma solution_near k t i : 0 <= t <= v -> Rabs (solution t i - iterate k t i) <= 2 * (/ 2) ^ k * E v.
Proof.
  intros Ht. assert (T2 : forall k p, Rabs (iterate (p + k) t i - iterate k t i) <= 2 * (/ 2) ^ k * E v).
  { intros k' p. eapply Rle_trans; [apply iterate_tail; exact Ht|].
    apply Rmult_le_compat_l; [pose proof (pow_le (/ 2) k' ltac:(lra)); lra|apply E_le; lra]. }
  assert (X : ex_finite_lim_seq (fun k => iterate k t i)).
  { apply ex_lim_seq_cauchy_corr. intros e. pose proof (E_1 v (proj1 Hv)) as E1.
    destruct (pow_lt_1_zero (/ 2) ltac:(rewrite Rabs_right; lra) (e / (4 * E v))
      ltac:(apply Rdiv_lt_0_compat; [apply cond_pos|lra])) as [N HN]. specialize (HN N (Nat.le_refl N)).
    apply Rabs_def2 in HN as [HN _]. apply (Rmult_lt_compat_l (4 * E v)) in HN; [|lra].
    replace (4 * E v * (e / (4 * E v))) with (pos e) in HN by (field; lra).
    exists N. intros n m Hn Hm. pose proof (T2 N (n - N)%nat) as A. pose proof (T2 N (m - N)%nat) as B.
    replace (n - N + N)%nat with n in A by lia. replace (m - N + N)%nat with m in B by lia.
    replace (iterate n t i - iterate m t i) with (iterate n t i - iterate N t i - (iterate m t i - iterate N t i)) by ring.
    eapply Rle_lt_trans; [apply Rabs_triang|]. rewrite Rabs_Ropp. lra. }
  apply Lim_seq_correct' in X. change (is_lim_seq (fun k => iterate k t i) (solution t i)) in X.
  assert (K : forall p, Rabs (iterate (p + k) t i - iterate k t i) <= 2 * (/ 2) ^ k * E v) by (intros; apply T2).
  apply (is_lim_seq_incr_n _ k) in X. apply Rabs_le.
  assert (L : Rbar_le (iterate k t i - 2 * (/ 2) ^ k * E v) (solution t i)).
  { apply (is_lim_seq_le (fun _ => iterate k t i - 2 * (/ 2) ^ k * E v) (fun p => iterate (p + k) t i)); [|apply is_lim_seq_const|exact X].
    intros p. specialize (K p). apply Rabs_le_between in K. lra. }
  assert (U : Rbar_le (solution t i) (iterate k t i + 2 * (/ 2) ^ k * E v)).
  { apply (is_lim_seq_le (fun p => iterate (p + k) t i) (fun _ => iterate k t i + 2 * (/ 2) ^ k * E v)); [|exact X|apply is_lim_seq_const].
    intros p. specialize (K p). apply Rabs_le_between in K. lra. }
  simpl in L, U. lra.
Qed.
Lemma solution_bounded t i : 0 <= t <= v -> Rabs (solution t i - x0 i) <= 2 * E v.
Proof. intros Ht. pose proof (solution_near 0 t i Ht) as H. simpl in H. lra. Qed.
Lemma solution_integral t i : 0 <= t <= v -> solution t i = x0 i + upper (fun u => f u (solution u) i) t.
Proof.
  intros Ht. pose proof (E_1 v (proj1 Hv)) as E1. apply Rminus_diag_uniq.
  enough (A : Rabs (solution t i - (x0 i + upper (fun u => f u (solution u) i) t)) = 0).
  { destruct (Req_dec (solution t i - (x0 i + upper (fun u => f u (solution u) i) t)) 0) as [|N]; [assumption|].
    contradiction (Rabs_no_R0 _ N). }
  apply (vanishes _ (2 * E v * E v)); [apply Rabs_pos|]. intros k. pose proof (solution_near (S k) t i Ht) as A. cbn [iterate] in A.
  pose proof (closer (iterate k) solution (2 * (/ 2) ^ k * E v) (2 * E v)) as C.
  assert (P : 0 <= 2 * (/ 2) ^ k * E v) by (apply Rmult_le_pos; [pose proof (pow_le (/ 2) k ltac:(lra))|]; lra).
  assert (N : forall t i, 0 <= t <= v -> Rabs (iterate k t i - x0 i) <= 2 * E v) by (intros u j Hu; pose proof (near_v k u j Hu); lra).
  specialize (C P N solution_bounded).
  assert (D : forall t i, 0 <= t <= v -> Rabs (iterate k t i - solution t i) <= 2 * (/ 2) ^ k * E v * E t).
  { intros u j Hu. rewrite Rabs_minus_sym. eapply Rle_trans; [apply solution_near; exact Hu|].
    rewrite <- (Rmult_1_r (2 * (/ 2) ^ k * E v)) at 1. apply Rmult_le_compat_l; [exact P|]. apply E_1. apply Hu. }
  specialize (C D t i Ht). set (a := upper (fun u => f u (iterate k u) i) t) in *. set (b := upper (fun u => f u (solution u) i) t) in *.
  replace (solution t i - (x0 i + b)) with (solution t i - (x0 i + a) + (a - b)) by ring. eapply Rle_trans; [apply Rabs_triang|].
  pose proof (E_le t ltac:(lra)) as E2. pose proof (Rmult_le_compat_l _ _ _ P E2) as P2.
  pose proof (Rmult_le_compat_l _ _ _ P E1) as P3. rewrite <- tech_pow_Rmult in A. lra.
Qed.
Let K := M + M * (2 * E v).
Lemma moved_bounded i : within_ K v (fun u => f u (solution u) i).
Proof. intros u Hu. apply right_side; [exact Hu|]. intros j. apply solution_bounded. exact Hu. Qed.
Lemma solution_steps t u i : 0 <= t <= v -> 0 <= u <= v -> Rabs (solution t i - solution u i) <= K * Rabs (t - u).
Proof.
  pose proof (moved_bounded i) as B.
  assert (L : forall t u, 0 <= u <= t -> t <= v -> Rabs (solution t i - solution u i) <= K * (t - u)).
  { intros t' u' H1 H2. rewrite !solution_integral by lra.
    assert (B' : within_ K t' (fun u => f u (solution u) i)) by (intros s Hs; apply B; lra).
    destruct (upper_step _ K u' t' (- K) K H1 B') as [U1 U2].
    { intros r Hr. specialize (B r ltac:(lra)). apply Rabs_le_between in B. exact B. }
    apply Rabs_le. lra. }
  intros Ht Hu. destruct (Rle_dec u t) as [H|H].
  - rewrite (Rabs_right (t - u)) by lra. apply L; lra.
  - rewrite (Rabs_minus_sym t u), (Rabs_right (u - t)), Rabs_minus_sym by lra. apply L; lra.
Qed.
End Until.

Theorem solvable : exists x : R -> I -> R, (forall i, x 0 i = x0 i) /\
  (forall t i, t < T -> continuous (fun u => x (Rmax 0 u) i) t) /\
  forall t i, 0 < t < T -> (forall z, continuous (fun u => f u z i) t) -> is_derive (fun u => x u i) t (f t (x t) i).
Proof.
  assert (Steps : forall t, 0 <= t < T -> exists d : posreal, exists K, 0 <= K /\ forall u i, 0 <= u -> Rabs (u - t) < d ->
    Rabs (solution u i - solution t i) <= K * Rabs (u - t)).
  { intros t Ht. destruct (Hf ((t + T) / 2) ltac:(lra)) as [M [HM HB]]. assert (Hd : 0 < (T - t) / 2) by lra.
    exists (mkposreal _ Hd), (M + M * (2 * exp (2 * M * ((t + T) / 2)))). split.
    - pose proof (exp_pos (2 * M * ((t + T) / 2))) as P. apply Rplus_le_le_0_compat; [exact HM|apply Rmult_le_pos; lra].
    - intros u i Hu0 Hu. simpl in Hu. apply Rabs_def2 in Hu.
      apply (solution_steps ((t + T) / 2) M ltac:(lra) HM HB u t i); lra. }
  exists solution. split; [|split].
  - intros i. destruct (Hf 0 ltac:(lra)) as [M [HM HB]]. rewrite (solution_integral 0 M ltac:(lra) HM HB 0 i ltac:(lra)), upper_0. ring.
  - intros t i Ht. apply filterlim_locally. intros e.
    destruct (Steps (Rmax 0 t) (conj (Rmax_l 0 t) (Rmax_lub_lt _ _ _ HT Ht))) as [d [K [HK HS]]].
    assert (Hd : 0 < Rmin d (e / (K + 1))).
    { apply Rmin_pos; [apply cond_pos|]. apply Rdiv_lt_0_compat; [apply cond_pos|lra]. }
    exists (mkposreal _ Hd). intros u Hu. change (Rabs (u - t) < Rmin d (e / (K + 1))) in Hu.
    change (Rabs (solution (Rmax 0 u) i - solution (Rmax 0 t) i) < e).
    pose proof (Rmin_l d (e / (K + 1))). pose proof (Rmin_r d (e / (K + 1))).
    assert (C : Rabs (Rmax 0 u - Rmax 0 t) <= Rabs (u - t)).
    { unfold Rmax. destruct (Rle_dec 0 u), (Rle_dec 0 t); unfold Rabs; repeat destruct Rcase_abs; lra. }
    specialize (HS (Rmax 0 u) i (Rmax_l 0 u) ltac:(lra)).
    assert (Q : Rabs (u - t) < e / (K + 1)) by lra. apply (Rmult_lt_compat_r (K + 1)) in Q; [|lra].
    replace (e / (K + 1) * (K + 1)) with (pos e) in Q by (field; lra). pose proof (Rabs_pos (u - t)).
    pose proof (Rmult_le_compat_l K _ _ HK C). lra.
  - intros t i Ht C. assert (Hv : 0 <= (t + T) / 2 < T) by lra.
    apply (is_derive_ext_loc (fun u => x0 i + upper (fun u => f u (solution u) i) u)).
    { assert (Hd : 0 < Rmin t ((T - t) / 2)) by (apply Rmin_pos; lra). exists (mkposreal _ Hd). intros u Hu.
      change (Rabs (u - t) < Rmin t ((T - t) / 2)) in Hu. pose proof (Rmin_l t ((T - t) / 2)). pose proof (Rmin_r t ((T - t) / 2)).
      apply Rabs_def2 in Hu. destruct (Hf _ Hv) as [M [HM HB]].
      rewrite (solution_integral _ M Hv HM HB u i); [reflexivity|lra]. }
    evar_last; [apply @is_derive_plus; [apply @is_derive_const|]|apply Rplus_0_l].
    apply (upper_derive (fun u => f u (solution u) i) T t); [|exact Ht|].
    + intros v Hvt. destruct (Hf v Hvt) as [M [HM HB]]. eexists. apply (moved_bounded v M Hvt HM HB).
    + destruct (Hf _ Hv) as [M [HM HB]]. destruct (Steps t ltac:(lra)) as [d [K [HK HS]]].
      apply filterlim_locally. intros e. assert (He : 0 < e / 2) by (pose proof (cond_pos e); lra).
      assert (C2 := proj1 (filterlim_locally _ _) (C (solution t)) (mkposreal _ He)). destruct C2 as [d2 C2].
      assert (P : 0 <= M * K) by (apply Rmult_le_pos; assumption).
      assert (Hd : 0 < Rmin (Rmin d d2) (Rmin (Rmin t ((T - t) / 2)) (e / 2 / (M * K + 1)))).
      { repeat apply Rmin_pos; try apply cond_pos; try lra. apply Rdiv_lt_0_compat; lra. }
      exists (mkposreal _ Hd). intros u Hu. change (Rabs (u - t) < Rmin (Rmin d d2) (Rmin (Rmin t ((T - t) / 2)) (e / 2 / (M * K + 1)))) in Hu.
      change (Rabs (f u (solution u) i - f t (solution t) i) < e).
      apply Rmin_Rgt_l in Hu as [Hu Hu2]. apply Rmin_Rgt_l in Hu as [U1 U2]. apply Rmin_Rgt_l in Hu2 as [Hu2 U5].
      apply Rmin_Rgt_l in Hu2 as [U3 U4]. assert (U6 : 0 <= u <= (t + T) / 2) by (apply Rabs_def2 in U3; apply Rabs_def2 in U4; lra).
      specialize (C2 u U2). change (Rabs (f u (solution t) i - f t (solution t) i) < e / 2) in C2.
      destruct (HB u i U6) as [_ B1]. specialize (B1 (solution u) (solution t) (K * Rabs (u - t)) (fun j => HS u j (proj1 U6) U1)).
      apply Rgt_lt in U5. apply (Rmult_lt_compat_r (M * K + 1)) in U5; [|lra].
      replace (e / 2 / (M * K + 1) * (M * K + 1)) with (e / 2) in U5 by (field; lra). pose proof (Rabs_pos (u - t)).
      replace (f u (solution u) i - f t (solution t) i)
        with (f u (solution u) i - f u (solution t) i + (f u (solution t) i - f t (solution t) i)) by ring.
      eapply Rle_lt_trans; [apply Rabs_triang|]. lra.
Qed.
End Equation.
