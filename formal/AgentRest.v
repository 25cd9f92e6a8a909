(** Agents that meet at rest: how far the common velocity takes them until it is 0, by a polynomial that is near the equation. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz FunctionalExtensionality.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Main AgentCertificate AgentForms AgentCheck AgentFall AgentMotion AgentEnd.
Open Scope R_scope.

(** * What never falls and is bounded has a limit *)
Lemma rises T f B : 0 < T -> (forall t u, 0 <= t <= u -> u < T -> f t <= f u) -> (forall t, 0 <= t < T -> f t <= B) ->
  exists l, filterlim f (at_left T) (locally l) /\ forall t, 0 <= t < T -> f t <= l.
Proof.
  intros HT Up HB. destruct (completeness (fun v => exists t, 0 <= t < T /\ v = f t)) as [l [U L]].
  - exists B. intros v [t [Ht ->]]. apply HB. exact Ht.
  - exists (f 0), 0. split; [lra|reflexivity].
  - exists l. split; [|intros t Ht; apply U; exists t; split; [exact Ht|reflexivity]].
    apply filterlim_locally. intros e. pose proof (cond_pos e) as He.
    destruct (Classical_Prop.classic (exists t, 0 <= t < T /\ l - e < f t)) as [[t0 [Ht0 H0]]|No].
    + assert (D : 0 < T - t0) by lra. exists (mkposreal _ D). intros t Bt Lt. unfold ball in Bt; simpl in Bt;
        unfold AbsRing_ball, abs, minus, plus, opp in Bt; simpl in Bt. apply Rabs_def2 in Bt.
      pose proof (Up t0 t ltac:(lra) Lt). assert (f t <= l) by (apply U; exists t; split; [lra|reflexivity]).
      apply Rabs_def1; unfold minus, plus, opp; simpl; lra.
    + exfalso. assert (l <= l - e); [|lra]. apply L. intros v [t [Ht ->]]. apply Rnot_lt_le. intros N. apply No. exists t. split; assumption.
Qed.

(** * Polynomials with integer coefficients *)
Fixpoint zeval (l : list Z) (v : R) : R := match l with [] => 0 | b :: l' => IZR b + v * zeval l' v end.
Fixpoint zslope (l : list Z) (v : R) : R := match l with [] => 0 | _ :: l' => zeval l' v + v * zslope l' v end.
Lemma zeval_derive l v : is_derive (zeval l) v (zslope l v).
Proof.
  induction l as [|b l IH]; [apply (is_derive_const 0)|]. cbn [zeval zslope].
  evar_last; [apply (is_derive_plus (fun _ => IZR b) (fun v => v * zeval l v) v 0 (1 * zeval l v + v * zslope l v))|].
  - apply @is_derive_const.
  - apply (is_derive_mult (fun v => v) (zeval l) v 1 (zslope l v)); [apply @is_derive_id|exact IH|intros; apply Rmult_comm].
  - unfold plus; simpl. ring.
Qed.
Lemma zeval_1 l : IZR (fold_right Z.add 0%Z l) = zeval l 1.
Proof. induction l as [|b l IH]; cbn [fold_right zeval]; [reflexivity|]. rewrite plus_IZR, IH. ring. Qed.
Lemma index_ok i : Q2R (index i) = INR i.
Proof. unfold index, Q2R. simpl. rewrite INR_IZR_INZ. field. Qed.
Lemma reduced_ok q : Q2R (reduced q) = Q2R q.
Proof. unfold reduced. cbv zeta. destruct (Qeq_bool _ q) eqn:E; [|reflexivity]. apply Qeq_bool_eq, Qeq_eqR in E. exact E. Qed.
Lemma qsum_ok n (g : nat -> Q) : Q2R (qsum (map g (seq 0 n))) = sum n (fun l => Q2R (g l)).
Proof. unfold sum. induction (seq 0 n) as [|i s IH]; simpl; [apply Q2R_0|]. rewrite Q2R_plus, IH. reflexivity. Qed.
Lemma span_ok c : Q2R (span c) = deadline c.
Proof. unfold span, deadline. destruct (kind c); [reflexivity|]. apply Q2R_plus. Qed.
Lemma abs_ok q : Q2R (Qabs q) = Rabs (Q2R q).
Proof.
  destruct q as [u w]. unfold Q2R. simpl. rewrite abs_IZR, Rabs_mult. f_equal. symmetry. apply Rabs_right. apply Rle_ge. left.
  apply Rinv_0_lt_compat. apply IZR_lt. reflexivity.
Qed.
Lemma near_ok p q r x : close_to p q r = true -> Rabs (Q2R q - x) <= Q2R r -> Rabs (Q2R (fst p) - x) <= Q2R (snd p).
Proof.
  intros H B. unfold close_to in H. apply Qle_bool_iff, Qle_Rle in H. rewrite Q2R_plus, abs_ok, Q2R_minus in H.
  replace (Q2R (fst p) - x) with ((Q2R (fst p) - Q2R q) + (Q2R q - x)) by ring. eapply Rle_trans; [apply Rabs_triang|]. lra.
Qed.
Lemma near_at p q x : close_to p q 0 = true -> Q2R q = x -> Rabs (Q2R (fst p) - x) <= Q2R (snd p).
Proof. intros H E. apply (near_ok p q 0 x H). rewrite E, Rminus_eq_0, Rabs_R0, Q2R_0. lra. Qed.
Lemma zeros l i : forallb (Qeq_bool 0) l = true -> at_ l i = 0.
Proof.
  intros H. unfold at_. destruct (nth_in_or_default i l 0%Q) as [I|E]; [|rewrite E; apply Q2R_0].
  rewrite forallb_forall in H. specialize (H _ I). apply Qeq_bool_eq, Qeq_eqR in H. rewrite <- H. apply Q2R_0.
Qed.
(** how far such a polynomial is from a series *)
Lemma misses_ok P W D v : 0 <= v <= 1 -> forall l j b,
  Rabs ((IZR P + IZR D * IZR j) * zeval l v + IZR D * v * zslope l v + IZR W * zeval (b :: l) v) <= IZR (misses P W D j b l).
Proof.
  intros Hv. induction l as [|u l IH]; intros j b; cbn [misses]; [rewrite abs_IZR, mult_IZR; cbn [zeval zslope]; apply Req_le; f_equal; ring|].
  specialize (IH (j + 1)%Z u). set (A := (IZR P + IZR D * IZR (j + 1)) * zeval l v + IZR D * v * zslope l v + IZR W * zeval (u :: l) v) in *.
  rewrite plus_IZR, abs_IZR, plus_IZR, !mult_IZR, plus_IZR, mult_IZR.
  replace ((IZR P + IZR D * IZR j) * zeval (u :: l) v + IZR D * v * zslope (u :: l) v + IZR W * zeval (b :: u :: l) v)
    with (((IZR P + IZR D * IZR j) * IZR u + IZR W * IZR b) + v * A) by (unfold A; cbn [zeval zslope]; rewrite plus_IZR; ring).
  eapply Rle_trans; [apply Rabs_triang|]. apply Rplus_le_compat_l. rewrite Rabs_mult, (Rabs_right v) by lra. pose proof (Rabs_pos A). nra.
Qed.
Lemma parts_of x : IZR (Qnum x) = IZR (Zpos (Qden x)) * Q2R x.
Proof. unfold Q2R. field. apply not_0_IZR. discriminate. Qed.
Theorem far_ok p w : 0 < Q2R p -> exists P dP : R -> R, (forall v, is_derive P v (dP v)) /\ Q2R (fst (far_q p w)) = P 1 /\
  forall v, 0 <= v <= 1 -> Rabs ((Q2R p + 1 + Q2R w * v) * P v + v * dP v - 1) <= Q2R (snd (far_q p w)).
Proof.
  intros Hp. unfold far_q. cbv zeta. set (x := reduced (p + 1)). set (y := reduced w). set (K := Z.to_nat _).
  set (P := (Qnum x * Zpos (Qden y))%Z). set (W := (Qnum y * Zpos (Qden x))%Z). set (D := (Zpos (Qden x) * Zpos (Qden y))%Z).
  set (u := (2 ^ (256 + 2 * Z.of_nat K))%Z). set (b := (D * u)%Z). set (q := (P * u)%Z). set (l := powers_of _ _ _ _ _ _). cbn [fst snd].
  assert (Ex : Q2R x = Q2R p + 1) by (unfold x; rewrite reduced_ok, Q2R_plus, Q2R_1; reflexivity).
  assert (Ey : Q2R y = Q2R w) by apply reduced_ok.
  assert (D0 : 0 < IZR D) by (apply IZR_lt; reflexivity). assert (U0 : 0 < IZR u) by (apply IZR_lt, Z.pow_pos_nonneg; lia).
  assert (EP : IZR P = IZR D * (Q2R p + 1)) by (unfold P, D; rewrite !mult_IZR, parts_of, Ex; ring).
  assert (EW : IZR W = IZR D * Q2R w) by (unfold W, D; rewrite !mult_IZR, parts_of, Ey; ring).
  assert (P0 : 0 < IZR P) by (rewrite EP; apply Rmult_lt_0_compat; lra).
  assert (Eq : IZR q = IZR P * IZR u) by (unfold q; apply mult_IZR). assert (Q0 : 0 < IZR q) by (rewrite Eq; apply Rmult_lt_0_compat; assumption).
  assert (NP : forall z, (0 < z)%Z -> ~ (inject_Z z == 0)%Q) by (intros z Hz Z0; unfold Qeq in Z0; simpl in Z0; lia).
  assert (Dz : (0 < D)%Z) by reflexivity. assert (Qz : (0 < q)%Z) by (apply lt_IZR; exact Q0).
  pose proof (NP q Qz) as NQ. pose proof (NP (D * q)%Z ltac:(apply Z.mul_pos_pos; assumption)) as ND.
  exists (fun v => zeval (b :: l) v / IZR q), (fun v => zslope (b :: l) v / IZR q). split; [|split].
  - intros v. apply (is_derive_ext (fun v => / IZR q * zeval (b :: l) v)); [intros z; apply Rmult_comm|].
    evar_last; [apply is_derive_scal; apply zeval_derive|]. unfold scal; simpl; unfold mult; simpl. unfold Rdiv. ring.
  - rewrite Q2R_div, !Effort.Q2R_inject, zeval_1 by exact NQ. reflexivity.
  - intros v Hv. rewrite Q2R_div, !Effort.Q2R_inject, mult_IZR by exact ND. pose proof (misses_ok P W D v Hv l 1%Z b) as M.
    set (e := IZR (misses P W D 1 b l)) in *.
    replace ((Q2R p + 1 + Q2R w * v) * (zeval (b :: l) v / IZR q) + v * (zslope (b :: l) v / IZR q) - 1)
      with (/ (IZR D * IZR q) * (v * ((IZR P + IZR D * 1) * zeval l v + IZR D * v * zslope l v + IZR W * zeval (b :: l) v))).
    + assert (I0 : 0 < / (IZR D * IZR q)) by (apply Rinv_0_lt_compat, Rmult_lt_0_compat; assumption).
      rewrite Rabs_mult, (Rabs_right (/ _)), Rabs_mult, (Rabs_right v) by lra. unfold Rdiv. rewrite Rmult_comm. apply Rmult_le_compat_r; [lra|].
      eapply Rle_trans; [|exact M]. set (A := Rabs _). pose proof (Rabs_pos ((IZR P + IZR D * 1) * zeval l v + IZR D * v * zslope l v + IZR W * zeval (b :: l) v)) as A0.
      fold A in A0. nra.
    + cbn [zeval zslope]. unfold b. rewrite EP, EW, Eq, EP, mult_IZR. field. repeat split; lra.
Qed.

Section Glide.
Variables (a : agents) (p w a2 f2 e : R) (P dP : R -> R).
Let c := graph a.
Let T := deadline c.
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hgain : positive_gain a.
Hypothesis Hcap : cap a = None.
Hypothesis Hf : 0 < f2.
Hypothesis Hp : p = f2 * k c.
Hypothesis Hw : w = (a2 + f2 * Q2R (slope a)) * T.
Hypothesis HP : forall v, is_derive P v (dP v).
Let miss v := (p + 1 + w * v) * P v + v * dP v - 1.
Hypothesis Hmiss : forall v, 0 <= v <= 1 -> Rabs (miss v) <= e.
Definition fades t : R := exp (- (a2 * t + f2 * turns a t)).
Definition glide t : R := RInt fades 0 t.
Let T_k := T_k a Hprot.
Lemma fades_derive t : t < T -> is_derive fades t (- (a2 + f2 * eta a t) * fades t).
Proof.
  intros Ht. evar_last.
  - apply (is_derive_comp exp (fun t => - (a2 * t + f2 * turns a t))); [apply is_derive_exp|]. apply @is_derive_opp. apply (is_derive_plus (fun t => a2 * t) (fun t => f2 * turns a t)).
    + apply is_derive_scal. apply @is_derive_id.
    + apply is_derive_scal. apply (turns_derive a Hprot). exact Ht.
  - unfold scal, opp, plus, one; simpl; unfold mult; simpl. fold (fades t). ring.
Qed.
Lemma fades_continuous t : t < T -> continuous fades t.
Proof. intros Ht. apply @ex_derive_continuous. eexists. apply fades_derive. exact Ht. Qed.
Lemma exp_le u v : u <= v -> exp u <= exp v.
Proof. intros [H| ->]; [left; apply exp_increasing; exact H|right; reflexivity]. Qed.
Lemma fades_below t : 0 <= t < T -> fades t <= exp (Rabs a2 * T) * exp (- (f2 * turns a t)).
Proof.
  intros Ht. unfold fades. rewrite <- exp_plus. apply exp_le. pose proof (Rle_abs (- a2)) as A. rewrite Rabs_Ropp in A.
  pose proof (Rabs_pos a2). assert (- (a2 * t) <= Rabs a2 * t) by nra. assert (Rabs a2 * t <= Rabs a2 * T) by (apply Rmult_le_compat_l; lra). lra.
Qed.
Lemma fades_at_most t : 0 <= t < T -> fades t <= exp (Rabs a2 * T).
Proof.
  intros Ht. eapply Rle_trans; [apply fades_below; exact Ht|]. rewrite <- (Rmult_1_r (exp (Rabs a2 * T))) at 2.
  apply Rmult_le_compat_l; [left; apply exp_pos|]. rewrite <- exp_0. apply exp_le. pose proof (turns_pos a Hprot Hgain t Ht).
  assert (0 <= f2 * turns a t) by (apply Rmult_le_pos; lra). lra.
Qed.
Lemma fades_vanish C : filterlim (fun t => fades t * C) (at_left T) (locally 0).
Proof.
  pose proof (exp_pos (Rabs a2 * T)) as E. apply (vanishes a Hprot Hgain _ 0%nat (2 * f2) (sq (exp (Rabs a2 * T) * C)) Hcap).
  - apply Rle_0_sqr.
  - simpl. pose proof (Rmult_lt_0_compat _ _ Hf (proj2 T_k)). lra.
  - intros t Ht. simpl pow. unfold sq at 2. rewrite !Rmult_1_l. pose proof (fades_below t Ht) as B. pose proof (exp_pos (- (a2 * t + f2 * turns a t))) as F0.
    fold (fades t) in F0. set (x := exp (- (f2 * turns a t))) in *.
    assert (X2 : exp (- (2 * f2 * turns a t)) = x * x) by (unfold x; rewrite <- exp_plus; f_equal; ring). rewrite X2.
    assert (S1 : fades t * fades t <= (exp (Rabs a2 * T) * x) * (exp (Rabs a2 * T) * x)) by (apply Rmult_le_compat; lra).
    unfold sq. apply Rle_trans with (fades t * fades t * (C * C)); [right; ring|].
    apply Rle_trans with ((exp (Rabs a2 * T) * x) * (exp (Rabs a2 * T) * x) * (C * C)); [|right; ring].
    apply Rmult_le_compat_r; [apply Rle_0_sqr|exact S1].
Qed.
(** times the gain it never grows, if it fades fast enough *)
Lemma fades_0 : fades 0 = 1.
Proof. unfold fades. rewrite (turns_0 a), !Rmult_0_r, Rplus_0_r, Ropp_0. apply exp_0. Qed.
Lemma fades_fast t : 1 <= f2 * k c -> 0 <= a2 + (f2 - / k c) * eta a 0 -> 0 <= t < T -> eta a t * fades t <= eta a 0.
Proof.
  intros H1 H2 Ht. destruct T_k as [A B]. fold c T in A, B. pose proof (eta_grows a Hprot) as Up. fold c T in Up.
  set (g := fun u => eta a u * fades u). assert (G0 : g 0 = eta a 0) by (unfold g; rewrite fades_0; ring). rewrite <- G0.
  apply (FamilyFlow.falls g 0 T (fun _ => corner a)); [| |exact Ht]; clear t Ht; intros t Ht.
  - apply (continuous_mult (eta a) fades); [apply eta_continuous; apply Ht|apply fades_continuous; apply Ht].
  - intros Hc. destruct (eta_derive a Hprot Hgain t (proj2 Ht) (Hc O)) as [d [Dd [d0 dk]]]. fold c in dk.
    exists (d * fades t + eta a t * (- (a2 + f2 * eta a t) * fades t)). split.
    + apply (is_derive_mult (eta a) fades); [exact Dd|apply fades_derive; apply Ht|intros; apply Rmult_comm].
    + pose proof (eta_pos a Hprot Hgain t (proj2 Ht)) as E0. specialize (Up 0 t ltac:(lra)). pose proof (exp_pos (- (a2 * t + f2 * turns a t))) as F0.
      fold (fades t) in F0. set (g0 := eta a t) in *. assert (K : d <= / k c * (g0 * g0)).
      { apply (Rmult_le_reg_l (k c)); [exact B|]. rewrite <- Rmult_assoc, Rinv_r, Rmult_1_l by lra. exact dk. }
      assert (P0 : 0 <= f2 - / k c).
      { apply (Rmult_le_reg_l (k c)); [exact B|]. rewrite Rmult_minus_distr_l, Rinv_r by lra. lra. }
      assert (Q0 : (f2 - / k c) * eta a 0 <= (f2 - / k c) * g0) by (apply Rmult_le_compat_l; assumption).
      assert (R0 : 0 <= g0 * (a2 + (f2 - / k c) * g0)) by (apply Rmult_le_pos; lra).
      replace (d * fades t + g0 * (- (a2 + f2 * g0) * fades t)) with (fades t * ((d - / k c * (g0 * g0)) - g0 * (a2 + (f2 - / k c) * g0))) by ring.
      assert (0 <= fades t * (g0 * (a2 + (f2 - / k c) * g0) - (d - / k c * (g0 * g0)))) by (apply Rmult_le_pos; lra). lra.
Qed.
Lemma glide_derive t : t < T -> is_derive glide t (fades t).
Proof.
  intros Ht. apply (is_derive_RInt fades glide 0 t); [|apply fades_continuous; exact Ht].
  assert (He : 0 < T - t) by lra. exists (mkposreal _ He). intros u Hu. unfold ball in Hu; simpl in Hu;
    unfold AbsRing_ball, abs, minus, plus, opp in Hu; simpl in Hu. apply Rabs_def2 in Hu.
  apply (RInt_correct fades). apply (ex_RInt_continuous fades). intros z [_ Hz]. apply fades_continuous.
  eapply Rle_lt_trans; [exact Hz|]. pose proof (proj1 T_k). apply Rmax_lub_lt; [assumption|lra].
Qed.
Lemma glide_0 : glide 0 = 0.
Proof. apply (RInt_point 0 fades). Qed.
Lemma glide_continuous t : t < T -> continuous glide t.
Proof. intros Ht. apply @ex_derive_continuous. eexists. apply glide_derive. exact Ht. Qed.
Let share t : 0 <= t < T -> 0 <= (T - t) / T <= 1.
Proof.
  intros Ht. pose proof (proj1 T_k) as A. fold c T in A. split; [left; apply Rdiv_lt_0_compat; lra|]. apply (Rmult_le_reg_r T); [exact A|].
  unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. lra.
Qed.
Let rest t := fades t * ((T - t) * P ((T - t) / T)).
Lemma rest_derive t : t < T -> is_derive rest t (- fades t * (1 + miss ((T - t) / T))).
Proof.
  intros Ht. destruct T_k as [A B]. fold c T in A, B. set (v := (T - t) / T) in *.
  assert (DP : is_derive (fun t => P ((T - t) / T)) t (- / T * dP v)).
  { apply (is_derive_comp P (fun t => (T - t) / T)); [apply HP|]. auto_derive; [exact I|field; lra]. }
  evar_last.
  - apply (is_derive_mult fades (fun t => (T - t) * P ((T - t) / T))); [apply fades_derive; exact Ht| |intros; apply Rmult_comm].
    apply (is_derive_mult (fun t => T - t) (fun t => P ((T - t) / T)) t (-1) (- / T * dP v)); [auto_derive; [exact I|ring]|exact DP|intros; apply Rmult_comm].
  - fold v. unfold mult, plus; simpl. unfold eta, miss. rewrite Hcap. unfold gain. fold c T. rewrite Hp, Hw.
    assert (Ev : T - t = v * T) by (unfold v; field; lra). rewrite Ev. assert (v <> 0) by (intros Z; rewrite Z in Ev; lra). field. split; lra.
Qed.
Lemma rest_vanishes : filterlim rest (at_left T) (locally 0).
Proof.
  destruct T_k as [A B]. fold c T in A, B.
  replace 0 with (0 * P 0) by ring. apply (filterlim_ext (fun t => (fades t * (T - t)) * P ((T - t) / T))); [intros; unfold rest; ring|].
  apply (filterlim_comp_2 (F := at_left T) (G := locally 0) (H := locally (P 0)) (fun t => fades t * (T - t)) (fun t => P ((T - t) / T)) Rmult);
    [| |apply (filterlim_mult 0 (P 0))].
  - apply (filterlim_locally (F := at_left T)). intros d. pose proof (proj1 (filterlim_locally (F := at_left T) _ 0) (fades_vanish T) d) as K.
    assert (N : at_left T (fun t => 0 <= t < T)).
    { exists (mkposreal _ A). intros t Bt Lt. unfold ball in Bt; simpl in Bt; unfold AbsRing_ball, abs, minus, plus, opp in Bt; simpl in Bt.
      apply Rabs_def2 in Bt. lra. }
    generalize (filter_and (F := at_left T) _ _ K N). apply (filter_imp (F := at_left T)). intros t [Bt Ht].
    unfold ball in *; simpl in *; unfold AbsRing_ball, abs, minus, plus, opp in *; simpl in *. rewrite Ropp_0, Rplus_0_r in *.
    eapply Rle_lt_trans; [|exact Bt]. rewrite !Rabs_mult. apply Rmult_le_compat_l; [apply Rabs_pos|]. rewrite !Rabs_right; lra.
  - assert (C : continuous (fun t => P ((T - t) / T)) T).
    { apply (continuous_comp (fun t => (T - t) / T) P); [|apply @ex_derive_continuous; eexists; apply HP].
      apply @ex_derive_continuous. auto_derive. exact I. }
    replace (P 0) with (P ((T - T) / T)) by (f_equal; field; lra). eapply filterlim_filter_le_1; [|exact C].
    intros Q [d Hd]. exists d. intros u Hu _. apply Hd. exact Hu.
Qed.
(** the distance is [T P(1)], but for what the series leaves *)
Theorem glides : exists m, filterlim glide (at_left T) (locally m) /\ 0 <= m /\ Rabs (m - T * P 1) <= e * m.
Proof.
  destruct T_k as [A B]. fold c T in A, B.
  assert (F0 : forall t, 0 < fades t) by (intros; apply exp_pos).
  destruct (rises T glide (exp (Rabs a2 * T) * T) A) as [m [L U]].
  - intros t u H1 H2. apply Ropp_le_cancel. apply (decreasing T t (fun t => - glide t) (fun t => - fades t)); [| | |lra]; intros s Hs.
    + apply @is_derive_opp. apply glide_derive. lra.
    + apply @continuous_opp. apply glide_continuous. lra.
    + specialize (F0 s). lra.
  - intros t Ht. assert (D : glide t - exp (Rabs a2 * T) * t <= glide 0 - exp (Rabs a2 * T) * 0).
    { apply (decreasing T 0 (fun t => glide t - exp (Rabs a2 * T) * t) (fun t => fades t - exp (Rabs a2 * T))); [| | |exact Ht]; intros s Hs.
      - evar_last; [apply (is_derive_minus glide (fun t => exp (Rabs a2 * T) * t)); [apply glide_derive; lra|apply is_derive_scal; apply @is_derive_id]|].
        unfold minus, plus, opp, one; simpl. ring.
      - apply (continuous_minus glide (fun t => exp (Rabs a2 * T) * t)); [apply glide_continuous; lra|].
        apply (continuous_mult (fun _ => exp (Rabs a2 * T)) (fun t => t)); [apply continuous_const|apply continuous_id].
      - pose proof (fades_at_most s ltac:(lra)). lra. }
    rewrite glide_0 in D. assert (exp (Rabs a2 * T) * t <= exp (Rabs a2 * T) * T) by (apply Rmult_le_compat_l; [left; apply exp_pos|lra]). lra.
  - exists m. split; [exact L|]. split; [rewrite <- glide_0; apply U; lra|].
    assert (R0 : rest 0 = T * P 1).
    { unfold rest, fades. rewrite (turns_0 a), !Rmult_0_r, Rplus_0_r, Ropp_0, exp_0, Rminus_0_r. unfold Rdiv. rewrite Rinv_r by lra. ring. }
    rewrite <- R0. assert (K : forall s, s = 1 \/ s = -1 -> s * (m - rest 0) <= e * m).
    { intros s Hs. set (f := fun t => s * (glide t + rest t - rest 0)). set (g := fun t => e * glide t).
      assert (I : forall t, 0 <= t < T -> f t - g t <= f 0 - g 0).
      { apply (decreasing T 0 (fun t => f t - g t) (fun t => s * (fades t + - fades t * (1 + miss ((T - t) / T)) - 0) - e * fades t));
          intros t Ht.
        - apply (is_derive_minus f g); [apply is_derive_scal|apply is_derive_scal; apply glide_derive; lra].
          apply (is_derive_minus (fun t => glide t + rest t) (fun _ => rest 0)); [|apply @is_derive_const].
          apply (is_derive_plus glide rest); [apply glide_derive; lra|apply rest_derive; lra].
        - apply (continuous_minus f g).
          + apply (continuous_mult (fun _ => s)); [apply continuous_const|]. apply (continuous_minus (fun t => glide t + rest t) (fun _ => rest 0)); [|apply continuous_const].
            apply (continuous_plus glide rest); [apply glide_continuous; lra|]. apply @ex_derive_continuous. eexists. apply rest_derive. lra.
          + apply (continuous_mult (fun _ => e)); [apply continuous_const|apply glide_continuous; lra].
        - specialize (F0 t). pose proof (Hmiss _ (share t Ht)) as M. set (v := miss ((T - t) / T)) in *.
          pose proof (Rle_abs (- v)) as Q1. rewrite Rabs_Ropp in Q1. pose proof (Rle_abs v) as Q2. destruct Hs as [-> | ->]; nra. }
      assert (I0 : f 0 - g 0 = 0) by (unfold f, g; rewrite glide_0; ring). rewrite I0 in I.
      assert (N : at_left T (fun t => f t <= g t)).
      { exists (mkposreal _ A). intros t Bt Lt. unfold ball in Bt; simpl in Bt; unfold AbsRing_ball, abs, minus, plus, opp in Bt; simpl in Bt.
        apply Rabs_def2 in Bt. specialize (I t ltac:(lra)). lra. }
      assert (Lf : filterlim f (at_left T) (locally (s * (m - rest 0)))).
      { evar_last.
        - apply (filterlim_comp _ _ _ (fun t => glide t + rest t - rest 0) (fun y => s * y) (at_left T) (locally (m + 0 - rest 0))); [|apply (continuous_mult (fun _ => s) (fun y => y)); [apply continuous_const|apply continuous_id]].
          apply (filterlim_comp_2 (F := at_left T) (G := locally (m + 0)) (H := locally (- rest 0)) (fun t => glide t + rest t) (fun _ => - rest 0) Rplus);
            [|apply filterlim_const|apply (filterlim_plus (m + 0) (- rest 0))].
          apply (filterlim_comp_2 (F := at_left T) (G := locally m) (H := locally 0) glide rest Rplus L rest_vanishes). apply (filterlim_plus m 0).
        - replace (s * (m - rest 0)) with (s * (m + 0 - rest 0)) by ring. reflexivity. }
      assert (Lg : filterlim g (at_left T) (locally (e * m))).
      { apply (filterlim_comp _ _ _ glide (fun y => e * y) (at_left T) (locally m)); [exact L|].
        apply (continuous_mult (fun _ => e) (fun y => y)); [apply continuous_const|apply continuous_id]. }
      exact (filterlim_le (F := at_left T) f g (s * (m - rest 0)) (e * m) N Lf Lg). }
    pose proof (K 1 ltac:(left; reflexivity)). pose proof (K (-1) ltac:(right; reflexivity)). apply Rabs_le. lra.
Qed.
End Glide.

(** * The common motion *)
Section Common.
Variables (a : agents) (h : nat -> R) (X : R -> nat -> nat -> R) (Sl : R -> nat -> R).
Let c := graph a.
Let T := deadline c.
Let d := prepare c.
Hypothesis Hedges : check_edges c (dls d) = true.
Hypothesis Hend : check_end c d = true.
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hgain : positive_gain a.
Hypothesis Hcap : cap a = None.
Hypothesis HX : flies a h X Sl.
Hypothesis Hn : degree a = 2%nat.
Hypothesis Hp0 : at_ (plant a) 0 = 0.
Hypothesis Hd0 : at_ (damping a) 0 = 0.
Let a2 := at_ (plant a) 1.
Let f2 := at_ (damping a) 1.
Hypothesis Hf : 0 < f2.
Let w (j i : nat) (t : R) := end_state c (placed h (X (Rmax 0 t)) i) j.
Let fade := fades a a2 f2.
Let far := glide a a2 f2.
Let some : (0 < degree a)%nat.
Proof. rewrite Hn. lia. Qed.
Let two i : (i < 2)%nat -> (i < degree a)%nat.
Proof. rewrite Hn. exact (fun H => H). Qed.
Lemma position_moves j t : 0 < t < T -> is_derive (w j 0) t (w j 1 t).
Proof.
  intros Ht. evar_last.
  - apply (end_derive a Hend some (fun u => placed h (X (Rmax 0 u)) 0) (fun l => X t 1%nat l)). intros l Hl. unfold placed. evar_last.
    + apply (is_derive_minus (fun u => X (Rmax 0 u) 0%nat l) (fun _ => h l)); [|apply @is_derive_const].
      apply (X_derive a h X Sl Hprot some HX t 0%nat l Ht (two 0 ltac:(lia)) Hl).
    + rewrite Hn. exact (Rminus_0_r _).
  - unfold w. rewrite Rmax_right by lra. f_equal. apply functional_extensionality. intros l. unfold placed. simpl. ring.
Qed.
Lemma velocity_moves j t : 0 < t < T -> is_derive (w j 1) t (- (a2 + f2 * eta a t) * w j 1 t).
Proof.
  intros Ht. pose proof (eta_pos a Hprot Hgain t (proj2 Ht)) as E0. evar_last.
  - apply (end_derive a Hend some (fun u => placed h (X (Rmax 0 u)) 1)
      (fun l => control a h (X t) t l - sum (degree a) (fun v => at_ (plant a) v * X t v l))). intros l Hl. unfold placed. evar_last.
    + apply (is_derive_minus (fun u => X (Rmax 0 u) 1%nat l) (fun _ => 0)); [|apply @is_derive_const].
      apply (X_derive a h X Sl Hprot some HX t 1%nat l Ht (two 1 ltac:(lia)) Hl).
    + rewrite Hn. exact (Rminus_0_r _).
  - unfold w. rewrite Rmax_right by lra.
    transitivity (end_state c (fun l => comb 2 (fun i => - (eta a t ^ 2 * at_ (gains a) i)) (fun i => lap (edges c) (y a h (X t) t i)) l
      + - (a2 + f2 * eta a t) * placed h (X t) 1 l) j).
    + f_equal. apply functional_extensionality. intros l. unfold control, comb, sum. rewrite Hn. cbn [seq fold_right]. rewrite Hp0, Hd0.
      fold a2 f2 c.
      assert (P1 : placed h (X t) 1 l = X t 1%nat l) by (unfold placed; simpl; ring).
      assert (Y1 : y a h (X t) t 1 l = X t 1%nat l / eta a t) by (unfold y; rewrite P1; simpl; field; lra). rewrite Y1, P1. field. lra.
    + rewrite (end_plus a), (end_scal a (- (a2 + f2 * eta a t)) (placed h (X t) 1)), (end_comb a), (sum_zero 2); [fold c; ring|].
      intros i _. rewrite (end_lap a Hedges Hend). ring.
Qed.
Lemma velocity j t : 0 <= t < T -> w j 1 t = fade t * w j 1 0.
Proof.
  intros Ht. assert (E : w j 1 t * exp (a2 * t + f2 * turns a t) = w j 1 0 * exp (a2 * 0 + f2 * turns a 0)).
  { assert (DE : forall u, u < T -> is_derive (fun u => exp (a2 * u + f2 * turns a u)) u ((a2 + f2 * eta a u) * exp (a2 * u + f2 * turns a u))).
    { intros u Hu. evar_last; [apply (is_derive_comp exp (fun u => a2 * u + f2 * turns a u)); [apply is_derive_exp|];
        apply (is_derive_plus (fun t => a2 * t) (fun t => f2 * turns a t)); apply is_derive_scal; [apply @is_derive_id|apply (turns_derive a Hprot); exact Hu]|].
      unfold scal, plus, one; simpl; unfold mult; simpl. ring. }
    apply (still T (fun u => w j 1 u * exp (a2 * u + f2 * turns a u))); [| |exact Ht]; intros u Hu.
    - evar_last; [apply (is_derive_mult (w j 1) (fun u => exp (a2 * u + f2 * turns a u))); [apply velocity_moves; exact Hu|apply DE; lra|intros; apply Rmult_comm]|].
      unfold plus, mult; simpl. ring.
    - apply (continuous_mult (w j 1) (fun u => exp (a2 * u + f2 * turns a u))).
      + apply (w_continuous a h X Sl Hend some HX j 1 u Hu (two 1 ltac:(lia))).
      + apply @ex_derive_continuous. eexists. apply DE. apply Hu. }
  rewrite (turns_0 a), !Rmult_0_r, Rplus_0_r, exp_0, Rmult_1_r in E. rewrite <- E. unfold fade, fades. rewrite exp_Ropp. field.
  apply Rgt_not_eq, exp_pos.
Qed.
Lemma position j t : 0 <= t < T -> w j 0 t = w j 0 0 + far t * w j 1 0.
Proof.
  intros Ht. assert (E : w j 0 t - far t * w j 1 0 = w j 0 0 - far 0 * w j 1 0).
  { apply (still T (fun u => w j 0 u - far u * w j 1 0)); [| |exact Ht]; intros u Hu.
    - evar_last; [apply (is_derive_minus (w j 0) (fun u => far u * w j 1 0)); [apply position_moves; exact Hu|]|].
      + apply (is_derive_mult far (fun _ => w j 1 0)); [apply (glide_derive a a2 f2 Hprot); apply Hu|apply @is_derive_const|intros; apply Rmult_comm].
      + rewrite (velocity j u) by lra. unfold minus, plus, opp, mult, zero; simpl. fold (fade u). ring.
    - apply (continuous_minus (w j 0) (fun u => far u * w j 1 0)).
      + apply (w_continuous a h X Sl Hend some HX j 0 u Hu (two 0 ltac:(lia))).
      + apply (continuous_mult far (fun _ => w j 1 0)); [apply (glide_continuous a a2 f2 Hprot); apply Hu|apply continuous_const]. }
  unfold far in E at 2. rewrite (glide_0 a a2 f2) in E. lra.
Qed.
End Common.
