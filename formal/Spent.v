(** What the input takes while sliding variables move: pieces of the time added up, and what comes after them. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Certificate Checker Flow Sound Slide Solution Exist Input Effort Peak Reach Driven Moving.
Open Scope R_scope.

(** the integral of what is at most a derivative *)
Lemma integral_to (T a : R) (H G dG : R -> R) : 0 <= a < T -> (forall u, u < T -> continuous H u) ->
  (forall u, u < T -> is_derive G u (dG u)) -> forall t, a <= t < T -> (forall u, a <= u <= t -> H u <= dG u) ->
  ex_RInt H a t /\ RInt H a t <= G t - G a.
Proof.
  intros Ha C D t Ht L. assert (E : forall u, u < T -> ex_RInt H a u).
  { intros u Hu. apply (ex_RInt_continuous (V := R_CompleteNormedModule)). intros z Hz. apply C. pose proof (Rmax_lub_lt a u T ltac:(lra) Hu). lra. }
  split; [apply E; lra|].
  assert (DH : forall u, u < T -> is_derive (fun u => RInt H a u) u (H u)).
  { intros u Hu. apply (is_derive_RInt H (fun u => RInt H a u) a u); [|apply C; assumption].
    assert (He : 0 < T - u) by lra. exists (mkposreal _ He). intros v Hv. apply (RInt_correct (V := R_CompleteNormedModule)), E.
    unfold ball in Hv; simpl in Hv; unfold AbsRing_ball, abs, minus, plus, opp in Hv; simpl in Hv. apply Rabs_def2 in Hv. lra. }
  destruct (MVT_gen (fun u => RInt H a u - G u) a t (fun u => H u - dG u)) as [c [Hc Eq]].
  - intros u Hu. rewrite Rmax_right in Hu by lra. apply @is_derive_minus; [apply DH; lra|apply D; lra].
  - intros u Hu. rewrite Rmax_right in Hu by lra. apply continuity_pt_filterlim.
    apply (continuous_minus (fun u => RInt H a u) G); apply @ex_derive_continuous; eexists; [apply DH; lra|apply D; lra].
  - rewrite Rmin_left, Rmax_right in Hc by lra. rewrite RInt_point in Eq. unfold zero in Eq; simpl in Eq.
    specialize (L c ltac:(lra)). assert ((H c - dG c) * (t - a) <= 0) by nra. lra.
Qed.
Section Spent.
Variables (c : cert) (T_r T_s mu1 mu2 mu3 delta : Q).
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hkind : kind c = SlidingMode T_r T_s mu1 mu2 mu3 delta.
Let T := deadline c.
Let r1 := Q2R (rho1 c).
Let kk := k c.
Let gain := gain T r1 kk.
Let s := s c.
Let pos3 : 0 < T /\ 0 < r1 /\ 0 < kk.
Proof. exact (Driven.positive c T_r T_s mu1 mu2 mu3 delta Hprot Hkind). Qed.
Variables (U : R -> R) (r x : Q) (l : list stretch) (y : Q) (o : instant).
Hypotheses (Hr : 0 < Q2R r) (Hx : 0 <= Q2R x).
Hypothesis U0 : forall t, 0 <= U t.
Hypothesis HS : stands c T_r mu2 mu3 o.
Let te := Q2R (time o).
Hypothesis HC : covers c U r l 0 te.
Hypothesis Hy : U te <= Q2R y.
Hypothesis late : forall t, te <= t < T -> U t <= exp (- (Q2R r / 2 * (s t - s te))) * U te.
Variable E : R -> R.
Hypothesis HE : forall t, 0 <= t < T -> 0 <= E t /\ E t <= Q2R x * U t.
Variable A : Q.
Hypothesis HA : forall t, 0 <= t < T -> E t <= Q2R A.
Let Ht : 0 <= te < T.
Proof. exact (proj1 HS). Qed.
Let G0 : Q2R (gain_at c o) = gain te.
Proof. exact (gain_ok c T_r T_s mu1 mu2 mu3 delta Hprot Hkind o HS). Qed.
Lemma y0 : 0 <= Q2R y. Proof. pose proof (U0 te). lra. Qed.
Lemma later t : te <= t < T -> E t <= exp (- (Q2R r / 2 * (s t - s te))) * (Q2R x * Q2R y).
Proof.
  intros H. destruct (HE t ltac:(lra)) as [_ B]. eapply Rle_trans; [exact B|]. specialize (late t H).
  pose proof (exp_pos (- (Q2R r / 2 * (s t - s te)))) as P. set (e := exp _) in *.
  replace (e * (Q2R x * Q2R y)) with (Q2R x * (e * Q2R y)) by ring. apply Rmult_le_compat_l; [exact Hx|].
  eapply Rle_trans; [exact late|]. apply Rmult_le_compat_l; [left; exact P|exact Hy].
Qed.
Lemma covered : forall ps a, covers c U r ps a te -> forall t, a <= t <= te -> t = te \/
  exists p, In p ps /\ U t <= Q2R (size_in p) /\ (2 <= kk * Q2R r -> gain t * U t <= Q2R (peak_in p)).
Proof.
  clear HC. induction ps as [|p ps IH]; intros a H t Hat; cbn [covers] in H; [left; apply Rle_antisym; [apply Hat|rewrite <- H; apply Hat]|]. destruct H as [b [H C]].
  destruct (Rle_lt_dec t b) as [L|L].
  - right. exists p. destruct H as [_ [_ [H _]]]. destruct (H t ltac:(lra)) as [H1 H2]. split; [left; reflexivity|]. split; assumption.
  - destruct (IH b C t ltac:(lra)) as [K|[q [K1 K2]]]; [left; exact K|right]. exists q. split; [right; exact K1|exact K2].
Qed.
Lemma peak_ok b : peak_moving c b A x o (l, y) r = true -> forall t, 0 <= t < T -> gain t * E t <= Q2R b.
Proof.
  unfold peak_moving. cbn [fst snd]. intros H t H0. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  apply Qle_ok in H1, H2. rewrite !Q2R_mult, G0 in H2. rewrite !Q2R_mult, Q2R_2 in H1. fold (k c) in H1. fold kk in H1.
  destruct (HE t H0) as [E0 E1]. destruct pos3 as [P1 [P2 P3]]. assert (G : 0 < gain t) by (apply gain_pos; lra).
  assert (L : te <= t -> gain t * E t <= Q2R b).
  { intros L. eapply Rle_trans; [|exact H2]. pose proof (later t (Logic.conj L (proj2 H0))) as B.
    pose proof (gain_decays c T_r T_s mu1 mu2 mu3 delta Hprot Hkind r te t H1 (Logic.conj (proj1 Ht) L) (proj2 H0)) as D. fold T r1 kk in D. fold gain s in D.
    pose proof y0. set (e := exp _) in *. eapply Rle_trans; [apply Rmult_le_compat_l; [lra|exact B]|].
    replace (gain t * (e * (Q2R x * Q2R y))) with (Q2R x * Q2R y * (gain t * e)) by ring. apply Rmult_le_compat_l; [apply Rmult_le_pos; assumption|exact D]. }
  destruct (Rle_lt_dec te t) as [K|K]; [apply L; exact K|]. apply orb_prop in H3 as [H3|H3].
  { apply Qle_ok in H3. rewrite Q2R_mult, G0 in H3. eapply Rle_trans; [|exact H3]. specialize (HA t H0).
    assert (M : gain t <= gain te) by (apply gain_grows; lra). rewrite (Rmult_comm (Q2R A)). apply Rmult_le_compat; lra. }
  destruct (covered l 0 HC t ltac:(lra)) as [->|[p [I [B1 B2]]]]; [lra|]. rewrite forallb_forall in H3. specialize (H3 p I).
    apply Qle_ok in H3. rewrite Q2R_mult in H3. eapply Rle_trans; [|exact H3]. specialize (B2 H1).
    apply Rle_trans with (gain t * (Q2R x * U t)); [apply Rmult_le_compat_l; lra|].
    replace (gain t * (Q2R x * U t)) with (Q2R x * (gain t * U t)) by ring. apply Rmult_le_compat_l; lra.
Qed.

(** * Integrals *)
Variable H : R -> R.
Hypothesis CH : forall u, u < T -> continuous H u.
Lemma cover_int (phi : stretch -> Q) (rest : R) :
  (forall p a b, holds_in c U r p a b -> forall t, a <= t <= b -> RInt H a t <= Q2R (phi p)) ->
  (forall t, te <= t < T -> RInt H te t <= rest) ->
  forall l0 a, 0 <= a -> covers c U r l0 a te -> forall t, a <= t < T -> RInt H a t <= Q2R (fold_right (fun p q => phi p + q)%Q 0%Q l0) + rest.
Proof.
  intros HP HR. assert (R0 : 0 <= rest) by (specialize (HR te ltac:(lra)); rewrite RInt_point in HR; exact HR).
  assert (N : forall p a b, holds_in c U r p a b -> 0 <= Q2R (phi p)).
  { intros p a b K. pose proof (HP p a b K a) as Q. rewrite RInt_point in Q. apply Q. destruct K as [K _]. lra. }
  assert (ND : forall l0 a, covers c U r l0 a te -> 0 <= Q2R (fold_right (fun p q => phi p + q)%Q 0%Q l0)).
  { clear - N. induction l0 as [|p l0 IH]; intros a C; cbn [fold_right covers] in *; [rewrite Q2R_0; lra|]. destruct C as [b [K C]].
    rewrite Q2R_plus. pose proof (N p a b K). pose proof (IH b C). lra. }
  induction l0 as [|p l0 IH]; intros a Ha C t Hat; cbn [fold_right covers] in *.
  - rewrite Q2R_0, Rplus_0_l. subst a. apply HR. exact Hat.
  - destruct C as [b [K C]]. rewrite Q2R_plus. pose proof (ND l0 b C) as N0. pose proof K as [K1 [K2 _]]. fold T in K2. destruct (Rle_lt_dec t b) as [L|L].
    + pose proof (HP p a b K t ltac:(lra)). lra.
    + assert (EX : forall u v, 0 <= u <= v -> v < T -> ex_RInt H u v).
      { intros u v Huv Hv. apply (ex_RInt_continuous (V := R_CompleteNormedModule)). intros z Hz. apply CH. rewrite Rmax_right in Hz by lra. lra. }
      rewrite <- (RInt_Chasles H a b t) by (apply EX; lra). unfold plus; simpl.
      pose proof (HP p a b K b ltac:(lra)). pose proof (IH b ltac:(lra) C t ltac:(lra)). lra.
Qed.
Lemma decay_derive : forall t, t < T -> is_derive (fun t => exp (- (Q2R r / 2 * (s t - s te)))) t (- (Q2R r / 2 * gain t) * exp (- (Q2R r / 2 * (s t - s te)))).
Proof.
  intros t Hlt. destruct pos3 as [P1 [P2 P3]]. apply (is_derive_after exp (fun t => - (Q2R r / 2 * (s t - s te)))); [apply is_derive_exp|].
  evar_last.
  - apply @is_derive_opp. apply is_derive_scal. apply @is_derive_minus; [apply clock_derive; [exact P1|exact Hlt]|apply @is_derive_const].
  - unfold minus, plus, opp, zero; simpl. fold T r1 kk. fold gain. ring.
Qed.
Lemma piece_int p a b (m : R) (D : R -> R) (dD : R -> R) (q : R) : holds_in c U r p a b -> 0 <= m -> (forall u, u < T -> is_derive D u (dD u)) ->
  (forall u, u < T -> 0 <= dD u) -> D b - D a <= q -> (forall u, a <= u <= b -> H u <= m * dD u) -> forall t, a <= t <= b -> RInt H a t <= q * m.
Proof.
  intros [K1 [K2 _]] Hm DD Hd Hq HH t Hat. fold T in K2.
  assert (Z1 : 0 <= a < T) by (split; [apply K1|]; eapply Rle_lt_trans; [apply K1|exact K2]).
  assert (Z2 : a <= t < T) by (split; [apply Hat|]; eapply Rle_lt_trans; [apply Hat|exact K2]).
  assert (I : RInt H a t <= m * D t - m * D a); [refine (proj2 (integral_to T a H (fun u => m * D u) (fun u => m * dD u) Z1 CH _ t Z2 _))|].
  - intros u Hu. apply is_derive_scal. apply DD. exact Hu.
  - intros u Hu. apply HH. lra.
  - cbv beta in I. eapply Rle_trans; [exact I|]. assert (M : - D b <= - D t).
    { apply (decreasing T t (fun u => - D u) (fun u => - dD u)); [| | |lra]; intros u Hu.
      - apply @is_derive_opp. apply DD. lra.
      - apply @ex_derive_continuous. eexists. apply @is_derive_opp. apply DD. lra.
      - specialize (Hd u ltac:(lra)). lra. }
    rewrite <- Rmult_minus_distr_l, (Rmult_comm q). apply Rmult_le_compat_l; lra.
Qed.
Lemma size_ok p a b t : holds_in c U r p a b -> a <= t <= b -> 0 <= E t /\ E t <= Q2R (lesser A (x * size_in p)).
Proof.
  intros [K1 [K2 [K3 _]]] Hat. fold T in K2. destruct (HE t ltac:(lra)) as [E0 E1]. split; [exact E0|].
  unfold lesser. destruct (Qle_bool A (x * size_in p)); [apply HA; lra|]. rewrite Q2R_mult. eapply Rle_trans; [exact E1|]. apply Rmult_le_compat_l; [exact Hx|]. apply (K3 t Hat).
Qed.
Lemma length_ok b : (forall u, 0 <= u < T -> H u = gain u * E u) -> length_moving b A x (l, y) r = true ->
  forall t, 0 <= t < T -> RInt H 0 t <= Q2R b.
Proof.
  intros HH HL t H0. unfold length_moving in HL. cbn [fst snd] in HL. apply Qle_ok in HL.
  rewrite Q2R_plus, !Q2R_mult, Q2R_div, Q2R_2 in HL by (apply nonzero; lra). eapply Rle_trans; [|exact HL]. rewrite Rplus_comm.
  destruct pos3 as [P1 [P2 P3]]. assert (Gp : forall u, u < T -> 0 < gain u) by (intros; apply gain_pos; lra). pose proof y0 as Y0.
  apply (cover_int (fun p => clock_in p * lesser A (x * size_in p))%Q) with (l0 := l); [| |lra|exact HC|exact H0].
  - intros p a b' K u Hu. pose proof K as [K1 [K2 [_ [K4 _]]]]. fold T in K2. rewrite (Q2R_mult (clock_in p)).
    apply (piece_int p a b' (Q2R (lesser A (x * size_in p))) s gain (Q2R (clock_in p)) K); auto.
    + destruct (size_ok p a b' a K ltac:(lra)). lra.
    + intros v Hv. apply clock_derive; [exact P1|exact Hv].
    + intros v Hv. left. apply Gp. exact Hv.
    + intros v Hv. rewrite HH by lra. destruct (size_ok p a b' v K Hv) as [_ Q]. rewrite (Rmult_comm (Q2R _)). apply Rmult_le_compat_l; [left; apply Gp; lra|exact Q].
  - intros u Hu. set (D := fun t => - (2 / Q2R r * (Q2R x * Q2R y)) * exp (- (Q2R r / 2 * (s t - s te)))).
    assert (I : RInt H te u <= D u - D te); [refine (proj2 (integral_to T te H D (fun t => gain t * (exp (- (Q2R r / 2 * (s t - s te))) * (Q2R x * Q2R y))) Ht CH _ u Hu _))|].
    + intros v Hv. unfold D. evar_last; [apply is_derive_scal; apply decay_derive; exact Hv|]. field. lra.
    + intros v Hv. rewrite HH by lra. apply Rmult_le_compat_l; [left; apply Gp; lra|]. apply later. lra.
    + eapply Rle_trans; [exact I|]. unfold D. rewrite Rminus_eq_0, Rmult_0_r, Ropp_0, exp_0.
      assert (0 <= 2 / Q2R r * (Q2R x * Q2R y) * exp (- (Q2R r / 2 * (s u - s te)))).
      { apply Rmult_le_pos; [|left; apply exp_pos]. apply Rmult_le_pos; [left; apply Rdiv_lt_0_compat; lra|apply Rmult_le_pos; lra]. }
      lra.
Qed.
Lemma energy_ok b : (forall u, 0 <= u < T -> H u = sq (gain u * E u)) -> energy_moving c b A x o (l, y) r = true ->
  forall t, 0 <= t < T -> RInt H 0 t <= Q2R b.
Proof.
  intros HH HL t H0. unfold energy_moving in HL. cbn [fst snd] in HL. cbv zeta in HL. apply andb_prop in HL as [HR HL]. apply Qle_ok in HL.
  apply negb_true_iff, Qle_no in HR. rewrite !Q2R_mult, Q2R_1 in HR. fold (k c) in HR. fold kk in HR.
  destruct pos3 as [P1 [P2 P3]]. destruct HS as [HS1 [HS2 _]]. fold te T in HS1, HS2.
  assert (EK : Q2R (rho2 c * kappa c) = kk) by apply Q2R_mult. assert (ET : Q2R (span c) = T) by apply span_ok.
  set (kq := (rho2 c * kappa c)%Q) in *. set (q := kk * Q2R r) in *. set (z := Q2R x * Q2R y). pose proof y0 as Y0.
  assert (Z0 : 0 <= z) by (apply Rmult_le_pos; lra).
  assert (Hs : 0 < Q2R (portion o)) by (rewrite HS2; apply Rdiv_lt_0_compat; lra).
  set (more := fun u => kk / (T - u)). assert (GM : forall u, gain u = r1 + more u) by reflexivity.
  assert (EL : Q2R (x * y * (x * y) * (gain_at c o + kq / (span c * portion o) / (kq * r - 1)) / r) = z * z * (gain te + more te / (q - 1)) / Q2R r).
  { rewrite Q2R_div by (apply nonzero; lra). rewrite !Q2R_mult, Q2R_plus, G0.
    assert (D1 : ~ (span c * portion o == 0)%Q) by (apply nonzero; rewrite Q2R_mult, ET; apply Rgt_not_eq, Rmult_lt_0_compat; lra).
    assert (D2 : ~ (kq * r - 1 == 0)%Q) by (apply nonzero; rewrite Q2R_minus, Q2R_mult, EK, Q2R_1; fold q; lra).
    rewrite !Q2R_div by assumption. rewrite Q2R_minus, !Q2R_mult, EK, ET, Q2R_1, HS2. fold q z. unfold more. f_equal. f_equal. f_equal. f_equal. field. split; lra. }
  rewrite Q2R_plus, EL in HL. eapply Rle_trans; [|exact HL]. rewrite Rplus_comm.
  assert (Gp : forall u, u < T -> 0 < gain u) by (intros; apply gain_pos; lra).
  apply (cover_int (fun p => square_in p * (lesser A (x * size_in p) * lesser A (x * size_in p)))%Q) with (l0 := l); [| |lra|exact HC|exact H0].
  - intros p a b' K u Hu. pose proof K as [K1 [K2 [_ [_ K5]]]]. fold T in K2. rewrite (Q2R_mult (square_in p)), (Q2R_mult (lesser A (x * size_in p)) (lesser A (x * size_in p))). set (m := Q2R (lesser A (x * size_in p))) in *.
    apply (piece_int p a b' (m * m) (squared c) (fun u => gain u * gain u) (Q2R (square_in p)) K); auto.
    + apply Rle_0_sqr.
    + intros v Hv. apply (squared_derive c T_r T_s mu1 mu2 mu3 delta Hprot Hkind v Hv).
    + intros v Hv. apply Rle_0_sqr.
    + intros v Hv. rewrite HH by lra. destruct (size_ok p a b' v K Hv) as [Q0 Q]. fold m in Q. pose proof (Gp v ltac:(lra)) as G.
      unfold sq. replace (gain v * E v * (gain v * E v)) with (E v * E v * (gain v * gain v)) by ring.
      apply Rmult_le_compat_r; [apply Rle_0_sqr|]. apply Rmult_le_compat; lra.
  - intros u Hu. set (e := fun t => exp (- (Q2R r / 2 * (s t - s te)))).
    set (D := fun t => - (z * z / Q2R r) * (e t * e t * (gain t + more t / (q - 1)))).
    set (dD := fun t => - (z * z / Q2R r) * ((- (Q2R r * gain t) * (e t * e t)) * (gain t + more t / (q - 1)) + e t * e t * (more t * more t / kk + more t * more t / kk / (q - 1)))).
    assert (DM : forall v, v < T -> is_derive more v (more v * more v / kk)).
    { intros v Hv. unfold more. auto_derive; [lra|]. field. lra. }
    assert (I : RInt H te u <= D u - D te); [refine (proj2 (integral_to T te H D dD Ht CH _ u Hu _))|].
    + intros v Hv. unfold D, dD. apply is_derive_scal. apply (is_derive_times (fun t => e t * e t) (fun t => gain t + more t / (q - 1))).
      * evar_last; [apply (is_derive_times e e); apply decay_derive; exact Hv|]. fold (e v). field.
      * apply @is_derive_plus.
        -- apply (is_derive_ext (fun u => r1 + more u)); [intros w; symmetry; apply GM|]. evar_last; [apply @is_derive_plus; [apply @is_derive_const|apply DM; exact Hv]|].
           unfold plus, zero; simpl. ring.
        -- apply (is_derive_ext (fun u => / (q - 1) * more u)); [intros w; apply Rmult_comm|]. evar_last; [apply is_derive_scal; apply DM; exact Hv|]. field. lra.
    + intros v Hv. rewrite HH by lra. pose proof (later v ltac:(lra)) as B. fold (e v) z in B. destruct (HE v ltac:(lra)) as [B0 _].
      pose proof (Gp v ltac:(lra)) as G. assert (Pe : 0 < e v) by apply exp_pos.
      assert (Q1 : sq (gain v * E v) <= sq (gain v) * (e v * e v) * (z * z)).
      { unfold sq. replace (gain v * gain v * (e v * e v) * (z * z)) with (gain v * (e v * z) * (gain v * (e v * z))) by ring.
        assert (gain v * E v <= gain v * (e v * z)) by (apply Rmult_le_compat_l; lra). assert (0 <= gain v * E v) by (apply Rmult_le_pos; lra). apply Rmult_le_compat; lra. }
      eapply Rle_trans; [exact Q1|]. unfold dD.
      assert (Pm : 0 < more v) by (unfold more; apply Rdiv_lt_0_compat; lra).
      assert (Er : Q2R r = q / kk) by (unfold q; field; lra).
      assert (Q2 : - (z * z / Q2R r) * (- (Q2R r * gain v) * (e v * e v) * (gain v + more v / (q - 1)) + e v * e v * (more v * more v / kk + more v * more v / kk / (q - 1)))
        = sq (gain v) * (e v * e v) * (z * z) + z * z * (e v * e v) * (more v / (q - 1)) * (gain v - more v)).
      { rewrite Er. unfold sq. field. repeat split; lra. }
      rewrite Q2. assert (0 <= z * z * (e v * e v) * (more v / (q - 1)) * (gain v - more v)); [|lra].
      apply Rmult_le_pos; [|rewrite GM; lra]. apply Rmult_le_pos; [|left; apply Rdiv_lt_0_compat; lra].
      apply Rmult_le_pos; apply Rle_0_sqr.
    + eapply Rle_trans; [exact I|]. unfold D. assert (E1 : e te = 1) by (unfold e; rewrite Rminus_eq_0, Rmult_0_r, Ropp_0, exp_0; reflexivity).
      rewrite E1. assert (Pm : 0 < more u) by (unfold more; apply Rdiv_lt_0_compat; lra). pose proof (Gp u ltac:(lra)) as G.
      assert (0 <= z * z / Q2R r * (e u * e u * (gain u + more u / (q - 1)))).
      { apply Rmult_le_pos; [apply Rmult_le_pos; [apply Rle_0_sqr|left; apply Rinv_0_lt_compat; lra]|]. apply Rmult_le_pos; [apply Rle_0_sqr|].
        assert (0 < more u / (q - 1)) by (apply Rdiv_lt_0_compat; lra). lra. }
      replace (z * z * (gain te + more te / (q - 1)) / Q2R r) with (z * z / Q2R r * (1 * 1 * (gain te + more te / (q - 1)))) by (field; lra). lra.
Qed.
End Spent.
