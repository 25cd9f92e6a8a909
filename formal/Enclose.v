(** Final states within their intervals. With [d = x - y], [x] the middles, [y] where agents end: of followers
    [L d = L x], and if [|d_i| = m u_i] is the largest multiple of [u], then [m (M u)_i <= |(L x)_i| + sum_j |w_ij| s_j],
    [s] the radii of leaders. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Mean Table Dominance Weighted Rest.
Open Scope R_scope.

Definition rowsum (h : edge -> Z) (es : list edge) : M.t Z := fold_right (fun e m => bump (tgt e) (h e) m) (M.empty Z) es.
Definition larger (a b : Z * Z) : Z * Z := if (fst a * snd b <? fst b * snd a)%Z then b else a.
Definition scale_of (c : cert) : Z := common (start c ++ sliding c ++ map fst (final c) ++ map snd (final c)).
(** followers, if all nodes that [lead] are within their intervals *)
Definition check_followers (c : cert) (lead : nat -> bool) (u : list Q) : bool :=
  let es := edges c in let n := order c in let ls := common (map wt es) in
  let sf := scale_of c in
  let uz := map (scaled (common u)) u in
  let X := table (map (scaled sf) (map fst (final c))) in let S := table (map (scaled sf) (map snd (final c))) in
  let U := table uz in
  let W e := scaled ls (wt e) in
  let A := rowsum (fun e => Z.abs (W e) * get X (tgt e) - W e * get X (src e))%Z es in
  let B := rowsum (fun e => Z.abs (W e) * (get U (tgt e) - if lead (src e) then 0 else get U (src e)))%Z es in
  let C := rowsum (fun e => Z.abs (W e) * if lead (src e) then get S (src e) else 0)%Z es in
  let F := filter (fun i => negb (lead i)) (seq 0 n) in
  let m := fold_right (fun i a => larger a (Z.abs (get A i) + get C i, get B i)%Z) (0, 1)%Z F in
  good ls (map wt es) && good sf (map fst (final c)) && good sf (map snd (final c)) && (0 <? snd m)%Z &&
  forallb (fun i => (0 <? get U i) && (0 <? get B i) && ((Z.abs (get A i) + get C i) * snd m <=? fst m * get B i) &&
    (fst m * get U i <=? get S i * snd m))%Z F.

Lemma rowsum_ok h es i : IZR (get (rowsum h es) i) = esum es (fun e => if (tgt e =? i)%nat then IZR (h e) else 0).
Proof.
  induction es as [|e es IH]; simpl; [rewrite get_empty; reflexivity|]. rewrite <- IH, get_bump. fold (rowsum h es).
  destruct (tgt e =? i)%nat; [rewrite plus_IZR; ring|ring].
Qed.
Section Followers.
Variables (c : cert) (lead : nat -> bool) (u : list Q) (y : nat -> R).
Hypothesis Hr : forall e, In e (edges c) -> (tgt e < order c)%nat /\ (src e < order c)%nat.
Hypothesis Hy : forall i, (i < order c)%nat -> lap (edges c) y i = 0.
Hypothesis H : check_followers c lead u = true.
Let p (i : nat) := nth i (final c) (0%Q, 0%Q).
Let off (i : nat) := Rabs (Q2R (fst (p i)) - y i).
Hypothesis Hlead : forall i, (i < order c)%nat -> lead i = true -> off i <= Q2R (snd (p i)).
Let es := edges c.
Let n := order c.
Let ls := common (map wt es).
Let sf := scale_of c.
Let X := table (map (scaled sf) (map fst (final c))).
Let S := table (map (scaled sf) (map snd (final c))).
Let U := table (map (scaled (common u)) u).
Theorem followers_ok i : (i < n)%nat -> off i <= Q2R (snd (p i)).
Proof.
  unfold check_followers in H. cbv zeta in H. fold es n ls sf X S U in H.
  set (A := rowsum (fun e => Z.abs (scaled ls (wt e)) * get X (tgt e) - scaled ls (wt e) * get X (src e))%Z es) in *.
  set (B := rowsum (fun e => Z.abs (scaled ls (wt e)) * (get U (tgt e) - if lead (src e) then 0 else get U (src e)))%Z es) in *.
  set (C := rowsum (fun e => Z.abs (scaled ls (wt e)) * if lead (src e) then get S (src e) else 0)%Z es) in *.
  set (m := fold_right _ _ _) in *. set (F := filter _ _) in *.
  apply andb_prop in H as [H' H5]. apply andb_prop in H' as [H' H4]. apply andb_prop in H' as [H' H3]. apply andb_prop in H' as [H1 H2].
  apply Z.ltb_lt, IZR_lt in H4. rewrite forallb_forall in H5.
  destruct (good_ok _ _ H1) as [L G]. destruct (good_ok _ _ H2) as [Lf _].
  apply IZR_lt in L, Lf. fold sf in Lf.
  assert (W : forall e, In e es -> IZR (scaled ls (wt e)) = IZR ls * Q2R (wt e)).
  { intros e He. apply scaled_ok; [apply lt_IZR; exact L|]. apply G. apply in_map. exact He. }
  assert (Z0 : Q2R 0 = 0) by (unfold Q2R; simpl; lra).
  assert (EX : forall j, IZR (get X j) = IZR sf * Q2R (fst (p j))).
  { intros j. unfold X. rewrite get_table, nth_scaled by exact H2. unfold p. change 0%Q with (fst (0%Q, 0%Q)) at 1. rewrite map_nth. reflexivity. }
  assert (ES : forall j, IZR (get S j) = IZR sf * Q2R (snd (p j))).
  { intros j. unfold S. rewrite get_table, nth_scaled by exact H3. unfold p. change 0%Q with (snd (0%Q, 0%Q)) at 1. rewrite map_nth. reflexivity. }
  assert (HF : forall j, In j F <-> (j < n)%nat /\ lead j = false).
  { intros j. unfold F. rewrite filter_In, in_seq, negb_true_iff. split; [intros [K1 K2]; split; [lia|exact K2]|intros [K1 K2]; split; [lia|exact K2]]. }
  assert (R5 : forall j, In j F -> 0 < IZR (get U j) /\ 0 < IZR (get B j) /\
    (Rabs (IZR (get A j)) + IZR (get C j)) * IZR (snd m) <= IZR (fst m) * IZR (get B j) /\
    IZR (fst m) * IZR (get U j) <= IZR (get S j) * IZR (snd m)).
  { intros j Hj. specialize (H5 j Hj). apply andb_prop in H5 as [K K4]. apply andb_prop in K as [K K3]. apply andb_prop in K as [K1 K2].
    apply Z.ltb_lt, IZR_lt in K1, K2. apply Z.leb_le, IZR_le in K3, K4. rewrite !mult_IZR in K3, K4. rewrite plus_IZR, abs_IZR in K3. tauto. }
  assert (OffS : forall j, (j < n)%nat -> lead j = true -> IZR sf * off j <= IZR (get S j)).
  { intros j Hj Lj. rewrite ES. apply Rmult_le_compat_l; [lra|apply Hlead; assumption]. }
  intros Hi. destruct (lead i) eqn:Li; [apply Hlead; assumption|].
  assert (Fi : In i F) by (apply HF; split; assumption).
  destruct (largest_of (fun j => IZR sf * off j / IZR (get U j)) F) as [b [Hb M]]; [intros E; rewrite E in Fi; destruct Fi|].
  set (mu := IZR sf * off b / IZR (get U b)) in *.
  assert (Bd : forall j, In j F -> IZR sf * off j <= mu * IZR (get U j)).
  { intros j Hj. specialize (M j Hj). destruct (R5 j Hj) as [U0 _]. apply (Rmult_le_compat_r (IZR (get U j))) in M; [|lra].
    unfold Rdiv in M. rewrite Rmult_assoc, Rinv_l, Rmult_1_r in M by lra. exact M. }
  assert (Eb : IZR sf * off b = mu * IZR (get U b)) by (unfold mu; field; destruct (R5 b Hb); lra).
  assert (O0 : forall j, 0 <= off j) by (intros j; apply Rabs_pos).
  assert (mu0 : 0 <= mu).
  { unfold mu. destruct (R5 b Hb) as [U0 _]. apply Rmult_le_pos; [apply Rmult_le_pos; [lra|apply O0]|left; apply Rinv_0_lt_compat; exact U0]. }
  destruct (proj1 (HF b) Hb) as [Bn Bl]. destruct (R5 b Hb) as [U0 [B0 [B1 _]]].
  (* the row of b *)
  assert (Row : mu * IZR (get B b) - IZR (get C b) <= Rabs (IZR (get A b))).
  { set (x := fun j => Q2R (fst (p j))). destruct (side_of (x b - y b)) as [g [G1 G2]].
    assert (EA : IZR (get A b) = IZR ls * IZR sf * lap es (fun j => x j - y j) b).
    { rewrite lap_minus, Hy by exact Bn. unfold A. rewrite rowsum_ok, lap_esum, Rminus_0_r, <- esum_scal. apply esum_ext.
      intros e He. unfold lap_edge. destruct (Nat.eqb_spec (tgt e) b) as [<-|]; [|ring].
      rewrite minus_IZR, !mult_IZR, abs_IZR, (W e He), !EX, Rabs_mult, (Rabs_right (IZR ls)) by lra. unfold x. ring. }
    apply Rle_trans with (g * IZR (get A b)).
    2: { pose proof (Rle_abs (IZR (get A b))). pose proof (Rle_abs (- IZR (get A b))) as V. rewrite Rabs_Ropp in V. destruct G1 as [-> | ->]; lra. }
    rewrite EA. unfold B, C. rewrite !rowsum_ok, lap_esum.
    replace (g * (IZR ls * IZR sf * esum es (fun e => lap_edge b (fun j => x j - y j) e)))
      with (g * IZR ls * IZR sf * esum es (fun e => lap_edge b (fun j => x j - y j) e)) by ring.
    apply Rle_trans with (mu * esum es (fun e => if (tgt e =? b)%nat then IZR (Z.abs (scaled ls (wt e)) * (get U (tgt e) - (if lead (src e) then 0 else get U (src e)))) else 0)
      + (-1) * esum es (fun e => if (tgt e =? b)%nat then IZR (Z.abs (scaled ls (wt e)) * (if lead (src e) then get S (src e) else 0)) else 0)); [lra|].
    rewrite <- !esum_scal.
    assert (PL : forall f g', esum es f + esum es g' = esum es (fun e => f e + g' e)).
    { intros f g'. clear. induction es as [|e l IH]; simpl; [ring|]. rewrite <- IH. ring. }
    rewrite PL. apply esum_le. intros e He. unfold lap_edge. destruct (Nat.eqb_spec (tgt e) b) as [Et|]; [|lra].
    destruct (Hr e He) as [_ Rs]. rewrite Et, !mult_IZR, minus_IZR, abs_IZR, (W e He), Rabs_mult, (Rabs_right (IZR ls)) by lra.
    set (w := Q2R (wt e)). set (us := IZR (if lead (src e) then 0 else get U (src e))%Z). set (ss := IZR (if lead (src e) then get S (src e) else 0)%Z).
    assert (D : IZR sf * off (src e) <= mu * us + ss).
    { unfold us, ss. destruct (lead (src e)) eqn:Ls.
      - rewrite Rmult_0_r, Rplus_0_l. apply OffS; assumption.
      - rewrite Rplus_0_r. apply Bd. apply HF. split; assumption. }
    assert (Q : g * (w * (x (src e) - y (src e))) <= Rabs w * off (src e)).
    { unfold off. fold (x (src e)). rewrite <- Rabs_mult. set (v := w * _). pose proof (Rle_abs v). pose proof (Rle_abs (- v)) as V.
      rewrite Rabs_Ropp in V. destruct G1 as [-> | ->]; lra. }
    assert (Ob : g * (x b - y b) = off b) by exact G2.
    pose proof (Rabs_pos w) as W0. apply (Rmult_le_compat_l _ _ _ W0) in D.
    replace (g * IZR ls * IZR sf * (Rabs w * (x b - y b) - w * (x (src e) - y (src e))))
      with (IZR ls * (Rabs w * (IZR sf * (g * (x b - y b))) - IZR sf * (g * (w * (x (src e) - y (src e)))))) by ring.
    rewrite Ob, Eb. apply (Rmult_le_compat_l (IZR sf)) in Q; [|lra].
    replace (mu * (IZR ls * Rabs w * (IZR (get U b) - us)) + -1 * (IZR ls * Rabs w * ss))
      with (IZR ls * (Rabs w * (mu * IZR (get U b)) - Rabs w * (mu * us + ss))) by ring.
    apply Rmult_le_compat_l; [lra|]. lra. }
  assert (Mm : mu * IZR (snd m) <= IZR (fst m)).
  { apply (Rmult_le_reg_r (IZR (get B b))); [exact B0|]. eapply Rle_trans; [|exact B1].
    replace (mu * IZR (snd m) * IZR (get B b)) with (mu * IZR (get B b) * IZR (snd m)) by ring.
    apply Rmult_le_compat_r; [lra|]. lra. }
  destruct (R5 i Fi) as [Ui [_ [_ Si]]]. apply (Rmult_le_reg_l (IZR sf)); [exact Lf|]. rewrite <- ES.
  eapply Rle_trans; [apply Bd; exact Fi|]. apply (Rmult_le_reg_r (IZR (snd m))); [exact H4|].
  eapply Rle_trans; [|exact Si]. replace (mu * IZR (get U i) * IZR (snd m)) with (mu * IZR (snd m) * IZR (get U i)) by ring.
  apply Rmult_le_compat_r; [lra|exact Mm].
Qed.
End Followers.
