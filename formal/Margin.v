(** The inequalities of the paper's own function: the matrix [S] against its least eigenvalue. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input.
Open Scope R_scope.

Lemma bil_map_seq n : forall (f : nat -> vec) x y,
  bil (map f (seq 0 n)) x y = fold_right (fun i a => x i * dot (f i) y + a) 0 (seq 0 n).
Proof.
  induction n as [|n IH]; intros f x y; simpl; [reflexivity|]. f_equal.
  rewrite <- seq_shift, map_map, (IH (fun i => f (S i)) (shift x) y).
  clear IH. induction (seq 0 n) as [|i l IHl]; simpl; [reflexivity|]. rewrite IHl. reflexivity.
Qed.
Lemma bil_identity n u y : bil (diagf 0 (repeat 1%Z n)) u y = fold_right (fun i a => u i * y i + a) 0 (seq 0 n).
Proof.
  rewrite bil_diagf. simpl. revert u y. induction n as [|n IH]; intros u y; simpl; [reflexivity|].
  change (shift (fun i => u i * y i)) with (fun i => shift u i * shift y i). rewrite IH, <- seq_shift, Rmult_1_l. f_equal.
  clear IH. induction (seq 0 n) as [|i l IHl]; simpl; [reflexivity|]. rewrite IHl. reflexivity.
Qed.
Lemma bil_by_rows n A : (length A <= n)%nat -> forall x y, bil A x y = fold_right (fun i a => app A y i * x i + a) 0 (seq 0 n).
Proof.
  revert A. induction n as [|n IH]; intros A H x y; destruct A as [|r A]; simpl in H; try lia; [reflexivity| |].
  - assert (Z : forall l, fold_right (fun i a => app [] y i * x i + a) 0 l = 0).
    { induction l as [|i l IHl]; simpl; [reflexivity|]. rewrite IHl. unfold app. destruct i; simpl; lra. }
    rewrite Z. reflexivity.
  - simpl. rewrite (IH A ltac:(lia) (shift x) y), <- seq_shift. unfold app at 2. simpl. rewrite Rmult_comm. f_equal.
    clear IH. induction (seq 0 n) as [|i l IHl]; simpl; [reflexivity|]. rewrite IHl. reflexivity.
Qed.
(** a form and its transpose *)
Lemma bil_symmetric n A x : (length A <= n)%nat -> bil (madd A (tmul A (diagf 0 (repeat 1%Z n)))) x x = 2 * bil A x x.
Proof. intros H. rewrite bil_madd, bil_tmul, bil_identity, <- (bil_by_rows n A H). ring. Qed.

Section Margin.
Variables (c : cert) (m : margin).
Let d := prepare c.
Let n := order c.
Let es := edges c.
Hypothesis Hls : good (dls d) (map wt es) = true.

(** the inequality itself *)
Lemma margin_one : check_margin c d m = true -> forall x, (forall i, (i < n)%nat -> ~ In i (on m) -> x i = 0) ->
  Q2R (least m) * norm2 n x <= margin_form es n m 1 x /\
  (Q2R (least m) * norm2 n x = margin_form es n m 1 x -> forall i, (i < n)%nat -> x i = 0).
Proof.
  intros H x Hx. unfold check_margin in H. cbv zeta in H. fold n in H. revert H.
  set (e := common (weights m ++ some_of (gammas m))). set (M := map (margin_row e (dls d) (dL d) m) (seq 0 n)).
  set (T := madd _ _). intros H.
  apply andb_prop in H as [H D]. apply andb_prop in H as [H _]. apply andb_prop in H as [H _]. apply andb_prop in H as [H F]. apply andb_prop in H as [G1 G2].
  destruct (fits_ok _ _ F) as [F1 _]. destruct (good_ok _ _ G2) as [Pe G3]. destruct (good_ok _ _ Hls) as [Pl _].
  assert (Z : forall i, mem i (filter (fun i => negb (mem i (on m))) (seq 0 n)) = true -> x i = 0).
  { intros i Hi. apply mem_In, filter_In in Hi as [Hs Hi]. apply in_seq in Hs. apply Hx; [fold n; lia|].
    intros Hin. apply mem_In in Hin. rewrite Hin in Hi. discriminate. }
  destruct (definite_off_ok _ _ _ D x Z) as [P0 P1]. rewrite bil_symmetric in P0, P1 by assumption.
  assert (EM : bil M x x = IZR e * IZR (dls d) * margin_form es n m 1 x).
  { unfold M. rewrite bil_map_seq. unfold margin_form.
    assert (K : forall l, (forall i, In i l -> (i < n)%nat) ->
      fold_right (fun i a => x i * dot (margin_row e (dls d) (dL d) m i) x + a) 0 l = IZR e * IZR (dls d) *
      fold_right (fun i a => match nth i (gammas m) None with Some g => Q2R g * sq (x i)
        | None => 2 * (Q2R (nth i (weights m) 0%Q) * if mem i (upto m) then 1 else 1) * (x i * lap es x i) end + a) 0 l).
    { induction l as [|i l IH]; intros Hl; cbn [fold_right]; [ring|]. rewrite IH by (intros; apply Hl; right; assumption).
      rewrite Rmult_plus_distr_l. f_equal. unfold margin_row.
      destruct (nth i (gammas m) None) as [g|] eqn:E.
      - rewrite dot_unit, mult_IZR, (scaled_ok e g Pe); [unfold sq; ring|]. apply G3. unfold some_of. apply in_flat_map.
        exists (Some g). split; [|left; reflexivity]. rewrite <- E. apply nth_In.
        destruct (le_lt_dec (length (gammas m)) i) as [L|L]; [rewrite nth_overflow in E by exact L; discriminate|exact L].
      - rewrite dot_scale. pose proof (app_lmat (dls d) es n x i Hls (Hl i ltac:(left; reflexivity))) as A.
        unfold app in A. change (lmat (dls d) es n) with (dL d) in A. rewrite A, mult_IZR.
        assert (W : IZR (scaled e (nth i (weights m) 0%Q)) = IZR e * Q2R (nth i (weights m) 0%Q)).
        { destruct (good_ok _ _ G1) as [_ G4]. apply scaled_ok; [exact Pe|]. apply G4.
          destruct (nth_in_or_default i (weights m) 0%Q) as [I|I]; [right; exact I|left; symmetry; exact I]. }
        rewrite W. destruct (mem i (upto m)); ring. }
    apply K. intros i Hi. apply in_seq in Hi. lia. }
  assert (ET : bil T x x = IZR e * IZR (dls d) * IZR (Zpos (Qden (least m))) *
    (margin_form es n m 1 x - Q2R (least m) * norm2 n x)).
  { unfold T. rewrite bil_madd, !bil_mscale, EM, bil_ones, opp_IZR, !mult_IZR. unfold Q2R. field. apply IZR_neq. discriminate. }
  rewrite ET in P0, P1. apply IZR_lt in Pe, Pl.
  assert (Pd : 0 < IZR (Zpos (Qden (least m)))) by (apply IZR_lt; reflexivity).
  set (q := IZR e * IZR (dls d) * IZR (Zpos (Qden (least m)))) in *.
  assert (Q0 : 0 < q) by (unfold q; repeat apply Rmult_lt_0_compat; assumption). fold es n. split.
  - apply (Rmult_le_reg_l (2 * q)); [lra|]. lra.
  - intros E. apply P1. fold es n in E. rewrite E. ring.
Qed.
(** of smaller weights on agents to whom no other listens: [S_r(x) = (1 - r) S_1(x') + r S_1(x)], [x' = 0] on them *)
Lemma margin_convex x r : check_margin c d m = true ->
  let x' i := if mem i (upto m) then 0 else x i in
  margin_form es n m r x = (1 - r) * margin_form es n m 1 x' + r * margin_form es n m 1 x.
Proof.
  intros H x'. unfold check_margin in H. cbv zeta in H. apply andb_prop in H as [H _]. apply andb_prop in H as [H He].
  apply andb_prop in H as [_ Hg]. rewrite forallb_forall in He, Hg. unfold margin_form.
  induction (seq 0 n) as [|i l IH]; cbn [fold_right]; [ring|]. rewrite IH. destruct (mem i (upto m)) eqn:E.
  - specialize (Hg i ltac:(apply mem_In; exact E)). destruct (nth i (gammas m) None); [discriminate|].
    assert (X : x' i = 0) by (unfold x'; rewrite E; reflexivity). rewrite X. ring.
  - assert (X : x' i = x i) by (unfold x'; rewrite E; reflexivity).
    assert (Lx : lap es x' i = lap es x i).
    { unfold lap. fold es in He. clear IH Hg Hls. induction es as [|e k' IHe]; simpl; [reflexivity|].
      rewrite IHe by (intros; apply He; right; assumption). f_equal. unfold lap_edge.
      destruct (Nat.eqb_spec (tgt e) i) as [T|T]; [|reflexivity]. specialize (He e (or_introl eq_refl)). rewrite T, E in He.
      simpl in He. apply negb_true_iff in He. rewrite X. unfold x'. rewrite He. reflexivity. }
    rewrite X, Lx. destruct (nth i (gammas m) None); ring.
Qed.
Lemma margin_ok : check_margin c d m = true -> margin_claim c m.
Proof.
  intros H x j Hx Hj Nj S. destruct (margin_one H x Hx) as [A B]. fold n es in S.
  assert (A1 : Q2R (least m) * norm2 n x < margin_form es n m 1 x) by (destruct A as [A|A]; [exact A|exfalso; auto]).
  split; [exact A1|]. intros L0 r [R0 R1]. set (x' := fun i => if mem i (upto m) then 0 else x i).
  destruct (margin_one H x') as [A' _].
  { intros i Hi Hn. unfold x'. destruct (mem i (upto m)); [reflexivity|apply Hx; assumption]. }
  rewrite L0, Rmult_0_l in A', A1. unfold S. rewrite (margin_convex x r H). fold x'.
  assert (P : 0 <= (1 - r) * margin_form es n m 1 x') by (apply Rmult_le_pos; lra).
  assert (Q : 0 < r * margin_form es n m 1 x) by (apply Rmult_lt_0_compat; lra). lra.
Qed.
End Margin.

(** * Forms of some coordinates alone *)
Lemma outside_row_ok fs r : forall j x y, outside_row fs j r = true -> (forall i, mem (j + i) fs = false -> x i = y i) ->
  dot r x = dot r y.
Proof.
  induction r as [|a r IH]; intros j x y H E; simpl; [reflexivity|]. simpl in H. apply andb_prop in H as [H1 H2].
  rewrite (IH (S j) (shift x) (shift y) H2) by (intros i Hi; apply E; rewrite Nat.add_succ_r; exact Hi). f_equal.
  apply orb_prop in H1 as [H1|H1].
  - rewrite (E 0%nat); [reflexivity|]. rewrite Nat.add_0_r. apply negb_true_iff. exact H1.
  - apply Z.eqb_eq in H1. subst a. ring.
Qed.
Lemma outside_ok fs A : forall k x x' y y', outside fs k A = true -> (forall i, mem (k + i) fs = false -> x i = x' i) ->
  (forall i, mem i fs = false -> y i = y' i) -> bil A x y = bil A x' y'.
Proof.
  induction A as [|r A IH]; intros k x x' y y' H Ex Ey; simpl; [reflexivity|]. simpl in H.
  apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  rewrite (IH (S k) (shift x) (shift x') y y' H3) by (auto; intros i Hi; apply Ex; rewrite Nat.add_succ_r; exact Hi).
  f_equal. rewrite (outside_row_ok fs r 0 y y' H2 Ey). apply orb_prop in H1 as [H1|H1].
  - rewrite (Ex 0%nat); [reflexivity|]. rewrite Nat.add_0_r. apply negb_true_iff. exact H1.
  - rewrite (zero_vec_ok r H1). ring.
Qed.
Lemma dot_off l : forall z : nat -> R, (forall i, (i < length l)%nat -> nth i l 0%Z = 0%Z \/ z i = 0) -> dot l z = 0.
Proof.
  induction l as [|a l IH]; intros z H; simpl; [reflexivity|].
  rewrite (IH (shift z)) by (intros i Hi; apply (H (S i)); simpl; lia).
  destruct (H 0%nat ltac:(simpl; lia)) as [E|E]; simpl in E; rewrite E; ring.
Qed.
Theorem nonneg_outside n fs sw fw T : outside fs 0 T = true ->
  nonneg n sw fw (madd T (diagf 0 (map (fun i => if mem i fs then 1 else 0)%Z (seq 0 n)))) = true -> forall x, 0 <= bil T x x.
Proof.
  intros HO HN x. set (x' := fun i => if mem i fs then 0 else x i).
  assert (E : forall i, mem i fs = false -> x i = x' i) by (intros i Hi; unfold x'; rewrite Hi; reflexivity).
  rewrite (outside_ok fs T 0 x x' x x' HO E E). pose proof (nonneg_ok _ _ _ _ HN x') as P.
  rewrite bil_madd, bil_diagf, dot_off in P; [lra|]. intros i Hi. rewrite map_length, seq_length in Hi.
  rewrite nth_map_seq by exact Hi. simpl. unfold x'. destruct (mem i fs); [right; ring|left; reflexivity].
Qed.

(** the value of a diagonal function *)
Lemma qbil_diagonal l x : qbil (diagonal_matrix l) x x = qdot l (fun i => sq (x i)).
Proof.
  assert (U : forall i q y, qdot (repeat 0%Q i ++ [q]) y = Q2R q * y i).
  { induction i as [|i IH]; intros q y; simpl; [lra|]. rewrite IH. unfold shift. replace (Q2R 0) with 0 by (unfold Q2R; simpl; lra). ring. }
  assert (K : forall l k z, qbil (map (fun i => repeat 0%Q (k + i) ++ [nth i l 0%Q]) (seq 0 (length l))) z x
    = qdot l (fun i => z i * x (k + i)%nat)).
  { clear l. induction l as [|a l IH]; intros k z; cbn [length seq map qbil qdot]; [reflexivity|].
    rewrite <- seq_shift, map_map, U, Nat.add_0_r. cbn [nth].
    rewrite (map_ext _ (fun i => repeat 0%Q (S k + i) ++ [nth i l 0%Q])) by (intros; rewrite Nat.add_succ_r; reflexivity).
    rewrite (IH (S k) (shift z)). rewrite (qdot_ext l _ (shift (fun i => z i * x (k + i)%nat))); [ring|].
    intros i _. unfold shift. rewrite Nat.add_succ_r. reflexivity. }
  exact (K l 0%nat x).
Qed.
