(** Lyapunov functions [V = E' diag(p) E] of many nodes. With [z = E], [z_i = d_i y_i], edge by edge

        2 p_t (|w| z_t^2 - w z_t z_s) >= p_t d_t |w| ((2 d_t - d_s) y_t^2 - d_s y_s^2),

    so [2 z' diag(p) L z >= b z' diag(p) z] if what falls to each [y_i^2] is at least [b p_i d_i^2]. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Mean Table.
Open Scope R_scope.

(** * The check *)
(** what one edge gives to the squares of its ends: [w] by [ls], weights [p] and vector [d] as integers *)
Definition share_out (ls : Z) (p d : M.t Z) (e : edge) (m : M.t Z) : M.t Z :=
  (let a := get p (tgt e) * get d (tgt e) * Z.abs (scaled ls (wt e)) in
   bump (tgt e) (a * (2 * get d (tgt e) - get d (src e))) (bump (src e) (- (a * get d (src e))) m))%Z.
Definition shares_out (ls : Z) (p d : M.t Z) (es : list edge) : M.t Z := fold_right (share_out ls p d) (M.empty Z) es.
Definition listens (es : list edge) : M.t Z := fold_right (fun e m => M.add (tgt e) 1%Z m) (M.empty Z) es.
(** [gamma]: a rate for each node that is proved otherwise, with its denominator; edges [outer] are not proved otherwise *)
Definition check_rows (n : nat) (es outer : list edge) (p d : list Q) (b : Q) (gamma : nat -> Z) (K : Z) : bool :=
  let ls := common (map wt es) in
  let dp := common p in let dd := common d in
  let pz := map (scaled dp) p in let dz := map (scaled dd) d in
  let P := table pz in let D := table dz in let E := listens es in
  let m := shares_out ls P D outer in
  good ls (map wt es) && good dp p && (0 <? K)%Z && okd K b && (length p =? n)%nat && forallb (Z.leb 0) pz && forallb (Z.leb 0) dz &&
  forallb (fun i => ((get E i =? 0) || (0 <? get D i))%Z &&
    (0 <=? K * get m i + (gamma i - scaled K b) * ls * get P i * (get D i * get D i))%Z) (seq 0 n).

(** * Sums *)
Definition esum (es : list edge) (f : edge -> R) : R := fold_right (fun e a => f e + a) 0 es.
Definition total (n : nat) (m : M.t Z) (y : nat -> R) : R := fsum (seq 0 n) (fun i => IZR (get m i) * y i).
Lemma esum_ext l f g : (forall e, In e l -> f e = g e) -> esum l f = esum l g.
Proof. induction l as [|e l IH]; intros H; simpl; [reflexivity|]. rewrite IH by (intros; apply H; right; assumption). rewrite H by (left; reflexivity). reflexivity. Qed.
Lemma fsum_plus l f g : fsum l (fun i => f i + g i) = fsum l f + fsum l g.
Proof. induction l as [|i l IH]; simpl; [ring|]. rewrite IH. ring. Qed.
Lemma fsum_le l f g : (forall i, In i l -> f i <= g i) -> fsum l f <= fsum l g.
Proof.
  induction l as [|i l IH]; intros H; simpl; [lra|]. pose proof (H i ltac:(left; reflexivity)).
  specialize (IH ltac:(intros; apply H; right; assumption)). lra.
Qed.
Lemma fsum_at n : forall k i (f : nat -> R), (k <= i < k + n)%nat -> fsum (seq k n) (fun j => if (i =? j)%nat then f j else 0) = f i.
Proof.
  assert (Z : forall n k i (f : nat -> R), ~ (k <= i < k + n)%nat -> fsum (seq k n) (fun j => if (i =? j)%nat then f j else 0) = 0).
  { induction n0 as [|m IH]; intros k i f H; simpl; [reflexivity|]. rewrite IH by lia. destruct (Nat.eqb_spec i k); [lia|ring]. }
  induction n as [|n IH]; intros k i f H; [lia|]. simpl. destruct (Nat.eqb_spec i k) as [->|N].
  - rewrite Z by lia. ring.
  - rewrite IH by lia. ring.
Qed.
Lemma total_bump n m i v y : (i < n)%nat -> total n (bump i v m) y = total n m y + IZR v * y i.
Proof.
  intros Hi. unfold total. rewrite <- (fsum_at n 0 i (fun j => IZR v * y j)) by lia. rewrite <- fsum_plus.
  apply fsum_ext. intros j _. rewrite get_bump. destruct (i =? j)%nat; [rewrite plus_IZR; ring|ring].
Qed.
Lemma total_empty n y : total n (M.empty Z) y = 0.
Proof.
  unfold total. rewrite (fsum_ext _ _ (fun i => 0 * 1)) by (intros; rewrite get_empty; simpl; ring). rewrite fsum_scal. ring.
Qed.
Lemma qdot_fsum p f : qdot p f = fsum (seq 0 (length p)) (fun i => Q2R (nth i p 0%Q) * f i).
Proof.
  revert f. induction p as [|a p IH]; intros f; simpl; [reflexivity|]. rewrite IH. f_equal.
  rewrite <- seq_shift. generalize (seq 0 (length p)). induction l as [|i l IHl]; simpl; [reflexivity|].
  rewrite IHl. reflexivity.
Qed.
Lemma qdot_at p : forall t (f : nat -> R), qdot p (fun i => if (t =? i)%nat then f i else 0) = Q2R (nth t p 0%Q) * f t.
Proof.
  assert (Z0 : Q2R 0 = 0) by (unfold Q2R; simpl; lra).
  induction p as [|a p IH]; intros t f; simpl; [destruct t; rewrite Z0; ring|]. destruct t as [|t]; simpl.
  - rewrite (qdot_ext p _ (fun i => 0 * 1)) by (intros; unfold shift; simpl; ring). rewrite qdot_scal. ring.
  - rewrite <- (IH t (fun i => f (S i))), Rmult_0_r, Rplus_0_l. apply qdot_ext. reflexivity.
Qed.
Lemma qdot_mult p z u es : qdot p (fun i => z i * lap es u i) =
  esum es (fun e => Q2R (nth (tgt e) p 0%Q) * (z (tgt e) * (Rabs (Q2R (wt e)) * u (tgt e) - Q2R (wt e) * u (src e)))).
Proof.
  induction es as [|e es IH]; simpl.
  - rewrite (qdot_ext p _ (fun i => 0 * 1)) by (intros; unfold lap; simpl; ring). rewrite qdot_scal. ring.
  - rewrite <- IH, <- (qdot_at p (tgt e) (fun i => z i * (Rabs (Q2R (wt e)) * u i - Q2R (wt e) * u (src e)))), <- qdot_plus.
    apply qdot_ext. intros i _. unfold lap. simpl. unfold lap_edge at 1. destruct (tgt e =? i)%nat; ring.
Qed.

Lemma quiet_node es x i : get (listens es) i = 0%Z -> lap es x i = 0.
Proof.
  unfold lap. induction es as [|e l IH]; simpl; [reflexivity|]. rewrite get_add. unfold lap_edge at 1.
  destruct (tgt e =? i)%nat; [discriminate|]. intros E. rewrite IH by exact E. ring.
Qed.

(** * Rows *)
Section Rows.
Variables (n : nat) (es outer : list edge) (p d : list Q) (b : Q) (gamma : nat -> Z) (K : Z).
Hypothesis Hrange : forall e, In e es -> (tgt e < n)%nat /\ (src e < n)%nat.
Hypothesis Houter : forall e, In e outer -> In e es.
Hypothesis H : check_rows n es outer p d b gamma K = true.
Let ls := common (map wt es).
Let dp := common p.
Let P := table (map (scaled dp) p).
Let D := table (map (scaled (common d)) d).
Definition half_edge (z : nat -> R) (e : edge) : R :=
  Q2R (nth (tgt e) p 0%Q) * (z (tgt e) * (Rabs (Q2R (wt e)) * z (tgt e) - Q2R (wt e) * z (src e))).

Lemma rows_parts : good ls (map wt es) = true /\ good dp p = true /\ (0 < K)%Z /\ okd K b = true /\ length p = n /\
  (forall i, 0 <= get P i)%Z /\ (forall i, 0 <= get D i)%Z /\
  forall i, (i < n)%nat -> (get (listens es) i = 0%Z \/ 0 < get D i)%Z /\
    (0 <= K * get (shares_out ls P D outer) i + (gamma i - scaled K b) * ls * get P i * (get D i * get D i))%Z.
Proof.
  unfold check_rows in H. cbv zeta in H. fold ls dp P D in H.
  apply andb_prop in H as [H0 H8]. apply andb_prop in H0 as [H0 H7]. apply andb_prop in H0 as [H0 H6].
  apply andb_prop in H0 as [H0 H5]. apply andb_prop in H0 as [H0 H4]. apply andb_prop in H0 as [H0 H3].
  apply andb_prop in H0 as [H1 H2]. apply Z.ltb_lt in H3. apply Nat.eqb_eq in H5.
  assert (N : forall l, forallb (Z.leb 0) l = true -> forall i, (0 <= nth i l 0)%Z).
  { intros l Hl i. rewrite forallb_forall in Hl. destruct (Nat.lt_ge_cases i (length l)) as [A|A].
    - apply Z.leb_le. apply Hl. apply nth_In. exact A.
    - rewrite nth_overflow by exact A. lia. }
  split; [assumption|]. split; [assumption|]. split; [assumption|]. split; [assumption|]. split; [assumption|].
  split; [intros i; unfold P; rewrite get_table; apply N; assumption|].
  split; [intros i; unfold D; rewrite get_table; apply N; assumption|].
  intros i Hi. rewrite forallb_forall in H8. specialize (H8 i ltac:(apply in_seq; lia)). apply andb_prop in H8 as [A B].
  split; [|apply Z.leb_le; exact B]. apply orb_prop in A as [A|A]; [left; apply Z.eqb_eq; exact A|right; apply Z.ltb_lt; exact A].
Qed.
Lemma P_ok i : IZR (get P i) = IZR dp * Q2R (nth i p 0%Q).
Proof. destruct rows_parts as [_ [G _]]. unfold P. rewrite get_table. apply nth_scaled. exact G. Qed.
Lemma W_ok e : In e es -> IZR (scaled ls (wt e)) = IZR ls * Q2R (wt e).
Proof.
  intros He. destruct rows_parts as [G _]. destruct (good_ok _ _ G) as [L G']. apply scaled_ok; [exact L|].
  apply G'. apply in_map. exact He.
Qed.
Lemma edge_shares y l : (forall e, In e l -> In e es) ->
  total n (shares_out ls P D l) (fun i => sq (y i)) <=
  IZR ls * IZR dp * (2 * esum l (half_edge (fun i => IZR (get D i) * y i))).
Proof.
  destruct rows_parts as [G [_ [_ [_ [_ [HP [HD _]]]]]]]. destruct (good_ok _ _ G) as [L _]. apply IZR_lt in L.
  induction l as [|e l IH]; intros Hl; simpl; [rewrite total_empty; lra|].
  specialize (IH ltac:(intros; apply Hl; right; assumption)). assert (He : In e es) by (apply Hl; left; reflexivity).
  destruct (Hrange e He) as [Rt Rs]. unfold share_out at 1. cbv zeta. rewrite !total_bump by assumption.
  fold (shares_out ls P D l). rewrite opp_IZR, !mult_IZR, minus_IZR, !mult_IZR, abs_IZR, (W_ok e He).
  unfold half_edge at 1.
  set (a := IZR dp * Q2R (nth (tgt e) p 0%Q)). pose proof (P_ok (tgt e)) as EP. fold a in EP. rewrite EP.
  assert (A : 0 <= a) by (rewrite <- EP; apply IZR_le; apply HP).
  pose proof (IZR_le _ _ (HD (tgt e))) as Dt. pose proof (IZR_le _ _ (HD (src e))) as Ds.
  set (dt := IZR (get D (tgt e))) in *. set (ds := IZR (get D (src e))) in *. set (w := Q2R (wt e)).
  set (yt := y (tgt e)). set (ys := y (src e)). rewrite Rabs_mult, (Rabs_right (IZR ls)) by lra.
  assert (C : - (Rabs w * (yt * yt + ys * ys)) <= - (2 * (w * (yt * ys)))).
  { pose proof (cross (- w) yt ys) as C. rewrite Rabs_Ropp in C. lra. }
  assert (B : 0 <= IZR ls * (a * dt * ds)) by (apply Rmult_le_pos; [lra|apply Rmult_le_pos; [apply Rmult_le_pos; assumption|assumption]]).
  apply (Rmult_le_compat_l _ _ _ B) in C.
  replace (IZR ls * IZR dp * (2 * (Q2R (nth (tgt e) p 0%Q) * (dt * yt * (Rabs w * (dt * yt) - w * (ds * ys))) + esum l (half_edge (fun i => IZR (get D i) * y i)))))
    with (IZR ls * a * (2 * (dt * yt * (Rabs w * (dt * yt) - w * (ds * ys)))) + IZR ls * IZR dp * (2 * esum l (half_edge (fun i => IZR (get D i) * y i))))
    by (unfold a; ring).
  unfold sq in *. fold yt ys. lra.
Qed.
(** all edges, if those that are not [outer] give each node its [gamma] *)
Theorem rows_ok x : let z := lap es x in
  fsum (seq 0 n) (fun i => IZR (gamma i) / IZR K * (Q2R (nth i p 0%Q) * sq (z i))) + 2 * esum outer (half_edge z)
    <= 2 * esum es (half_edge z) ->
  Q2R b * qdot p (fun i => sq (z i)) <= 2 * qdot p (fun i => z i * lap es z i).
Proof.
  intros z HG. rewrite (qdot_mult p z z es). fold (half_edge z). eapply Rle_trans; [|exact HG].
  destruct rows_parts as [G [Gp [HK [OK [Lp [HP [HD HR]]]]]]]. destruct (good_ok _ _ G) as [L _]. destruct (good_ok _ _ Gp) as [Lp' _].
  set (y := fun i => z i / IZR (get D i)).
  assert (Ez : forall i, (i < n)%nat -> z i = IZR (get D i) * y i).
  { intros i Hi. unfold y. destruct (HR i Hi) as [[A|A] _].
    - unfold z. rewrite (quiet_node es x i A). unfold Rdiv. ring.
    - apply IZR_lt in A. field. lra. }
  pose proof (edge_shares y outer Houter) as S. apply IZR_lt in L, Lp', HK.
  assert (Es : esum outer (half_edge (fun i => IZR (get D i) * y i)) = esum outer (half_edge z)).
  { apply esum_ext. intros e He. destruct (Hrange e (Houter e He)) as [Rt Rs]. unfold half_edge.
    rewrite <- !Ez by assumption. reflexivity. }
  rewrite Es in S. rewrite qdot_fsum, Lp.
  apply (Rmult_le_reg_l (IZR ls * IZR dp)); [nra|]. apply (Rmult_le_reg_l (IZR K)); [assumption|].
  apply Rle_trans with (IZR K * (IZR ls * IZR dp * fsum (seq 0 n) (fun i => IZR (gamma i) / IZR K * (Q2R (nth i p 0%Q) * sq (z i)))
    + total n (shares_out ls P D outer) (fun i => sq (y i)))); [|apply Rmult_le_compat_l; lra].
  unfold total. rewrite <- !fsum_scal, <- fsum_plus, <- !fsum_scal. apply fsum_le. intros i Hi. apply in_seq in Hi.
  destruct (HR i ltac:(lia)) as [_ B]. apply IZR_le in B. rewrite plus_IZR, !mult_IZR, minus_IZR in B.
  assert (HK' : (0 < K)%Z) by (apply lt_IZR; assumption).
  rewrite (scaled_ok K b HK' OK), P_ok in B. rewrite (Ez i) by lia. unfold sq.
  pose proof (Rle_0_sqr (y i)) as Y. unfold Rsqr in Y. apply (Rmult_le_compat_r _ _ _ Y) in B. rewrite Rmult_0_l in B.
  set (g := IZR (gamma i)) in *. set (q := Q2R (nth i p 0%Q)) in *. set (dd := IZR (get D i)) in *. set (yi := y i) in *.
  set (m := IZR (get (shares_out ls P D outer) i)) in *.
  replace (IZR K * (IZR ls * IZR dp * (g / IZR K * (q * (dd * yi * (dd * yi)))) + m * (yi * yi)))
    with (IZR ls * IZR dp * (g * (q * (dd * yi * (dd * yi)))) + IZR K * m * (yi * yi)) by (field; lra).
  lra.
Qed.
End Rows.
