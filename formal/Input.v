(** Lemmas on coordinates: their size against the value of the Lyapunov function, the input, and its bound. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound.
Open Scope R_scope.

(** * Sums of squares *)
Lemma sq_pos x : 0 <= sq x.
Proof. apply Rle_0_sqr. Qed.
Lemma norm2_pos n x : 0 <= norm2 n x.
Proof. unfold norm2. induction (seq 0 n) as [|i l IH]; simpl; [lra|]. pose proof (sq_pos (x i)). lra. Qed.
Lemma norm2_shift n x : norm2 (S n) x = sq (x 0%nat) + norm2 n (shift x).
Proof.
  unfold norm2. simpl. f_equal. rewrite <- seq_shift.
  induction (seq 0 n) as [|i l IH]; simpl; [reflexivity|]. rewrite IH. reflexivity.
Qed.
Lemma norm2_entry n x i : (i < n)%nat -> sq (x i) <= norm2 n x.
Proof.
  revert x i. induction n as [|n IH]; intros x i Hi; [lia|]. rewrite norm2_shift. destruct i as [|i].
  - pose proof (norm2_pos n (shift x)). lra.
  - specialize (IH (shift x) i ltac:(lia)). unfold shift at 1 in IH. unfold sq at 2. nra.
Qed.
Lemma bil_ones n x : bil (diagf 0 (repeat 1%Z n)) x x = norm2 n x.
Proof.
  rewrite bil_diagf. simpl. revert x. induction n as [|n IH]; intros x; simpl; [reflexivity|].
  rewrite norm2_shift, <- IH. unfold sq. unfold shift at 1. change (fun i => x (S i) * x (S i)) with (fun i => shift x i * shift x i). ring.
Qed.
Lemma lap_source n es i x : mem i (sources n es) = true -> lap es x i = 0.
Proof.
  intros H. apply mem_In in H. unfold sources in H. apply filter_In in H as [_ H].
  unfold lap. induction es as [|e es IH]; simpl in *; [reflexivity|]. unfold lap_edge at 1.
  destruct (tgt e =? i)%nat; simpl in *; [discriminate|]. rewrite IH by assumption. ring.
Qed.

(** * [lowest |z|^2 <= V <= highest |z|^2] *)
Section Ends.
Variable c : cert.
Let d := prepare c.
Let n := order c.
Let es := edges c.
Hypothesis Hls : good (dls d) (map wt es) = true.
Lemma end_form_ok PZ e q x : bil (end_form n PZ e q) x x
  = IZR (Zpos (Qden q)) * bil PZ x x - IZR (Qnum q) * IZR e * norm2 n x.
Proof. unfold end_form. rewrite bil_madd, !bil_mscale, bil_ones, opp_IZR, mult_IZR. ring. Qed.
Lemma matrix_ends_ok f P : check_ends c d f = true -> ly f = InE P -> forall z, (forall i, mem i (dsrc d) = true -> z i = 0) ->
  Q2R (lowest f) * norm2 n z <= qbil P z z <= Q2R (highest f) * norm2 n z.
Proof.
  unfold check_ends. intros H EP z Hz. apply andb_prop in H as [_ H3]. rewrite EP in H3. cbv zeta in H3.
  set (e := common (concat P)) in *. set (PZ := map (map (scaled e)) P) in *.
  apply andb_prop in H3 as [H3 H5]. apply andb_prop in H3 as [H3 H4]. apply andb_prop in H3 as [G E0].
  apply Z.ltb_lt in E0. apply IZR_lt in E0.
  assert (B : bil PZ z z = IZR e * qbil P z z) by (apply bil_scaled; assumption).
  split.
  - pose proof (semidefinite_off_ok _ _ _ H4 z Hz) as K. fold n in K. rewrite end_form_ok, B in K.
    assert (D : 0 < IZR (Zpos (Qden (lowest f)))) by (apply IZR_lt; reflexivity).
    unfold Q2R. apply (Rmult_le_reg_l (IZR e * IZR (Zpos (Qden (lowest f))))); [nra|].
    replace (IZR e * IZR (Zpos (Qden (lowest f))) * (IZR (Qnum (lowest f)) * / IZR (Zpos (Qden (lowest f))) * norm2 n z))
      with (IZR (Qnum (lowest f)) * IZR e * norm2 n z) by (field; lra). lra.
  - pose proof (semidefinite_off_ok _ _ _ H5 z Hz) as K. rewrite bil_mscale in K. fold n in K. rewrite end_form_ok, B in K.
    assert (D : 0 < IZR (Zpos (Qden (highest f)))) by (apply IZR_lt; reflexivity).
    unfold Q2R. apply (Rmult_le_reg_l (IZR e * IZR (Zpos (Qden (highest f))))); [nra|].
    replace (IZR e * IZR (Zpos (Qden (highest f))) * (IZR (Qnum (highest f)) * / IZR (Zpos (Qden (highest f))) * norm2 n z))
      with (IZR (Qnum (highest f)) * IZR e * norm2 n z) by (field; lra). lra.
Qed.
Lemma ends_ok f : check_ends c d f = true -> 0 < Q2R (lowest f) /\
  (forall x, Q2R (lowest f) * norm2 n (coords es (ly f) x) <= V es (ly f) x) /\
  (forall x, V es (ly f) x <= Q2R (highest f) * norm2 n (coords es (ly f) x)).
Proof.
  intros H0. pose proof H0 as H. unfold check_ends in H. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 _].
  assert (L0 : 0 < Q2R (lowest f)).
  { apply Z.ltb_lt in H1. unfold Q2R. apply Rmult_lt_0_compat; [apply IZR_lt; assumption|].
    apply Rinv_0_lt_compat. apply IZR_lt. reflexivity. }
  split; [exact L0|]. destruct (ly f) as [P|p g|p] eqn:El; [| |discriminate].
  - split; intros x; apply (matrix_ends_ok f P H0 El); intros i; apply (lap_source n).
  - apply andb_prop in H3 as [Hl H3]. apply Nat.eqb_eq in Hl. rewrite forallb_forall in H3.
    assert (K : forall z : nat -> R, Q2R (lowest f) * norm2 (length p) z <= qdot p (fun i => sq (z i)) /\
      qdot p (fun i => sq (z i)) <= Q2R (highest f) * norm2 (length p) z).
    { clear Hl El. induction p as [|a p IH]; intros z.
      - unfold norm2. simpl. lra.
      - simpl length. rewrite norm2_shift. simpl.
        destruct (IH ltac:(intros; apply H3; right; assumption) (shift z)) as [A B].
        specialize (H3 a ltac:(left; reflexivity)). apply andb_prop in H3 as [X Y].
        apply Qle_bool_iff, Qle_Rle in X, Y. change (shift (fun i => sq (z i))) with (fun i => sq (shift z i)).
        pose proof (sq_pos (z 0%nat)). nra. }
    fold n in Hl. rewrite <- Hl. split; intros x; apply K.
Qed.

(** * [e_i^2 <= c_i V] *)
Lemma constants_ok f cs : check_constants c d f = true -> constants f = Some cs -> forall x i, (i < n)%nat ->
  sq (lap es x i) <= Q2R (nth i cs 0%Q) * V es (ly f) x.
Proof.
  unfold check_constants. intros H E x i Hi. rewrite E in H. destruct (ly f) as [P| |]; [|discriminate|discriminate].
  cbv zeta in H. set (e := common (concat P)) in *. set (PZ := map (map (scaled e)) P) in *.
  apply andb_prop in H as [H H']. apply andb_prop in H as [G E0]. apply Z.ltb_lt in E0. apply IZR_lt in E0.
  fold n in H'. destruct (factor_off n (dsrc d) PZ) as [r|] eqn:ER; [|discriminate].
  apply andb_prop in H' as [Hl H']. apply Nat.eqb_eq in Hl. rewrite forallb_forall in H'.
  assert (K : In (i, nth i cs 0%Q) (combine (seq 0 n) cs)).
  { apply (in_numbered _ cs 0%nat); [apply nth_error_nth'; fold n in Hl; lia|assumption]. }
  specialize (H' _ K). cbn [fst snd] in H'. apply andb_prop in H' as [Hn H']. set (q := nth i cs 0%Q) in *.
  destruct (factor_off_ok _ _ _ _ ER (lap es x) (fun i => lap_source n es i x)) as [P0 B].
  assert (EB : bil PZ (lap es x) (lap es x) = IZR e * qbil P (lap es x) (lap es x)) by (apply bil_scaled; assumption).
  rewrite EB in P0, B. cbn [V coords]. set (v := qbil P (lap es x) (lap es x)) in *.
  assert (V0 : 0 <= v) by (apply (Rmult_le_reg_l (IZR e)); [assumption|lra]).
  assert (D : 0 < IZR (Zpos (Qden q))) by (apply IZR_lt; reflexivity).
  apply orb_prop in H' as [H'|H'].
  - rewrite (lap_source n) by assumption. unfold sq. rewrite Rmult_0_l. apply Rmult_le_pos; [|assumption].
    apply Z.leb_le in Hn. unfold Q2R. apply Rmult_le_pos; [apply IZR_le; assumption|left; apply Rinv_0_lt_compat; assumption].
  - specialize (B _ _ _ H'). rewrite dot_unit, Rmult_1_l, mult_IZR in B. unfold sq, Q2R.
    apply (Rmult_le_reg_l (IZR (Zpos (Qden q)) * IZR e)); [nra|].
    replace (IZR (Zpos (Qden q)) * IZR e * (IZR (Qnum q) * / IZR (Zpos (Qden q)) * v)) with (IZR (Qnum q) * (IZR e * v))
      by (field; lra). lra.
Qed.

(** * The input against the coordinates *)
Hypothesis Hsrc : forall e, In e es -> (src e < n)%nat.
Lemma two_squares a b : sq (a + b) <= 2 * sq a + 2 * sq b.
Proof. unfold sq. pose proof (Rle_0_sqr (a - b)) as H. unfold Rsqr in H. lra. Qed.
Lemma lap_bound : exists B, 0 <= B /\ forall x i, (i < n)%nat -> sq (lap es x i) <= B * norm2 n x.
Proof.
  revert Hsrc. unfold lap. generalize es as l. induction l as [|e l IH]; intros Hl; simpl.
  - exists 0. split; [lra|]. intros. unfold sq. lra.
  - destruct (IH ltac:(intros; apply Hl; right; assumption)) as [B [B0 HB]].
    set (w := Q2R (wt e)). exists (2 * (4 * sq w) + 2 * B). split; [pose proof (sq_pos w); lra|]. intros x i Hi.
    eapply Rle_trans; [apply two_squares|]. specialize (HB x i Hi). pose proof (norm2_pos n x) as N0.
    assert (K : sq (lap_edge i x e) <= 4 * sq w * norm2 n x).
    { unfold lap_edge. fold w. destruct (tgt e =? i)%nat; [|unfold sq at 1; pose proof (sq_pos w); nra].
      pose proof (norm2_entry n x i Hi) as A. pose proof (norm2_entry n x (src e) (Hl e ltac:(left; reflexivity))) as A'.
      unfold Rminus. eapply Rle_trans; [apply two_squares|].
      assert (E1 : sq (Rabs w * x i) = sq w * sq (x i)).
      { unfold sq. replace (Rabs w * x i * (Rabs w * x i)) with (Rabs w * Rabs w * (x i * x i)) by ring.
        rewrite <- Rabs_mult, Rabs_right by nra. ring. }
      assert (E2 : sq (- (w * x (src e))) = sq w * sq (x (src e))) by (unfold sq; ring).
      rewrite E1, E2. pose proof (sq_pos w). nra. }
    lra.
Qed.
Lemma lap_linear x y m i : lap es (fun j => x j - m * y j) i = lap es x i - m * lap es y i.
Proof.
  unfold lap. generalize es. clear. intros l. induction l as [|e l IH]; simpl; [ring|]. rewrite IH. unfold lap_edge. destruct (tgt e =? i)%nat; ring.
Qed.
Lemma coords_ok f : match ly f with InE _ => true | InEps _ g => forallb (fun r => (zdot r g =? 0)%Z) (dL d) | Weighted _ => false end = true ->
  exists B, 0 <= B /\ forall x i, (i < n)%nat -> sq (lap es x i) <= B * norm2 n (coords es (ly f) x).
Proof.
  intros H. destruct lap_bound as [B [B0 HB]]. destruct (ly f) as [P|p g|p]; cbn [coords]; [| |discriminate].
  - exists 1. split; [lra|]. intros x i Hi. rewrite Rmult_1_l. apply (norm2_entry n (lap es x) i Hi).
  - exists B. split; [exact B0|]. intros x i Hi. specialize (HB (fun j => x j - mean p g x * sgn g j) i Hi).
    rewrite lap_linear in HB. assert (Z : lap es (sgn g) i = 0); [|rewrite Z, Rmult_0_r, Rminus_0_r in HB; exact HB].
    rewrite forallb_forall in H. pose proof (app_lmat (dls d) es n (sgn g) i Hls Hi) as E.
    change (sgn g) with (vec_of g) in E at 1. unfold app in E. rewrite zdot_ok in E.
    assert (Hin : In (nth i (dL d) []) (dL d)).
    { apply nth_In. change (dL d) with (lmat (dls d) es n). unfold lmat. rewrite map_length, seq_length. exact Hi. }
    specialize (H _ Hin). apply Z.eqb_eq in H. change (lmat (dls d) es n) with (dL d) in E. rewrite H in E.
    destruct (good_ok _ _ Hls) as [P0 _]. apply IZR_lt in P0.
    symmetry in E. apply Rmult_integral in E as [E|E]; [lra|exact E].
Qed.
End Ends.

(** * [gain^2 e^(-r s)] is bounded if [r k >= 2] *)
Lemma gain_decay T rho1 k r t : 0 < T -> 0 < rho1 -> 0 < k -> 2 <= k * r -> 0 <= t < T ->
  sq (gain T rho1 k t) * exp (- (r * clock T rho1 k t)) <= sq (rho1 + k / T).
Proof.
  intros HT H1 Hk Hr Ht. unfold clock. set (l := ln (T / (T - t))).
  assert (Hi : 0 < / (T - t)) by (apply Rinv_0_lt_compat; lra).
  assert (L0 : 0 <= l).
  { unfold l. rewrite <- ln_1. destruct (proj1 Ht) as [P|<-].
    - left. apply ln_increasing; [lra|]. apply (Rmult_lt_reg_r (T - t)); [lra|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l; lra.
    - rewrite Rminus_0_r. right. f_equal. field. lra. }
  assert (R0 : 0 < r) by nra.
  assert (E : exp (- (r * (rho1 * t + k * l))) <= exp (- (2 * l))).
  { destruct (Rle_lt_dec (2 * l) (r * (rho1 * t + k * l))) as [A|A].
    - destruct A as [A|A]; [left; apply exp_increasing; lra|rewrite A; lra].
    - exfalso. assert (0 <= r * (rho1 * t)) by (apply Rmult_le_pos; [lra|apply Rmult_le_pos; lra]). nra. }
  assert (X : exp (- (2 * l)) = sq ((T - t) / T)).
  { replace (- (2 * l)) with (- l + - l) by ring. rewrite exp_plus. unfold sq.
    assert (Y : exp (- l) = (T - t) / T).
    { rewrite exp_Ropp. unfold l. rewrite exp_ln; [field; lra|]. apply Rdiv_lt_0_compat; lra. }
    rewrite Y. reflexivity. }
  rewrite X in E. unfold gain. assert (G : 0 <= sq (rho1 + k / (T - t))) by apply sq_pos.
  eapply Rle_trans; [apply Rmult_le_compat_l; [exact G|exact E]|].
  replace (sq (rho1 + k / (T - t)) * sq ((T - t) / T)) with (sq (rho1 * ((T - t) / T) + k / T)) by (unfold sq; field; lra).
  assert (A : 0 <= (T - t) / T <= 1).
  { split; [apply Rmult_le_pos; [lra|left; apply Rinv_0_lt_compat; lra]|].
    apply (Rmult_le_reg_r T); [lra|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l; lra. }
  assert (B : 0 < k / T) by (apply Rdiv_lt_0_compat; lra). unfold sq. apply Rmult_le_compat; nra.
Qed.
Lemma input_bounded n T rho1 k : 0 < T -> 0 < rho1 -> 0 < k -> forall r t0, 0 <= t0 < T -> 2 <= k * r ->
  forall (E : R -> nat -> R) C, (forall t i, t0 <= t < T -> (i < n)%nat ->
    sq (E t i) <= C * exp (- (r * (clock T rho1 k t - clock T rho1 k t0)))) ->
  exists K, forall t i, t0 <= t < T -> (i < n)%nat -> Rabs (gain T rho1 k t * E t i) <= K.
Proof.
  intros HT H1 Hk r t0 H0 Hr E C H. set (e0 := exp (r * clock T rho1 k t0)).
  exists (Rabs C * (sq (rho1 + k / T) * e0) + 1). intros t i Ht Hi. specialize (H t i Ht Hi).
  pose proof (gain_decay T rho1 k r t HT H1 Hk Hr ltac:(lra)) as G. assert (P0 : 0 < e0) by apply exp_pos.
  replace (- (r * (clock T rho1 k t - clock T rho1 k t0))) with (- (r * clock T rho1 k t) + r * clock T rho1 k t0) in H by ring.
  rewrite exp_plus in H. fold e0 in H. set (e := exp (- (r * clock T rho1 k t))) in *. assert (P1 : 0 < e) by apply exp_pos.
  set (g := gain T rho1 k t) in *. set (y := E t i) in *. pose proof (Rle_abs C) as AC. pose proof (Rabs_pos C) as AP.
  assert (S : sq (g * y) <= Rabs C * (sq (rho1 + k / T) * e0)).
  { replace (sq (g * y)) with (sq g * sq y) by (unfold sq; ring). assert (G0 : 0 <= sq g) by apply sq_pos.
    eapply Rle_trans; [apply Rmult_le_compat_l; [exact G0|exact H]|].
    eapply Rle_trans; [apply Rmult_le_compat_l; [exact G0|apply Rmult_le_compat_r; [|exact AC]; apply Rlt_le, Rmult_lt_0_compat; assumption]|].
    replace (sq g * (Rabs C * (e * e0))) with (Rabs C * (sq g * e * e0)) by ring.
    apply Rmult_le_compat_l; [exact AP|]. apply Rmult_le_compat_r; [lra|exact G]. }
  set (M := Rabs C * (sq (rho1 + k / T) * e0)) in *. unfold sq in S. apply Rabs_le. split; nra.
Qed.
