(** What [V = E' diag(p) E] proves along every motion. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Mean Slide Main Table Dominance.
Open Scope R_scope.

(** * Decay along a motion *)
Lemma lap_ext n es x y i : (forall e, In e es -> (tgt e < n)%nat /\ (src e < n)%nat) ->
  (forall j, (j < n)%nat -> x j = y j) -> lap es x i = lap es y i.
Proof.
  intros Hr H. unfold lap. induction es as [|e es IH]; simpl; [reflexivity|].
  rewrite IH by (intros; apply Hr; right; assumption). destruct (Hr e ltac:(left; reflexivity)) as [Rt Rs].
  f_equal. unfold lap_edge. destruct (Nat.eqb_spec (tgt e) i) as [<-|]; [|reflexivity]. rewrite !H by assumption. reflexivity.
Qed.
Lemma is_derive_lap n es i (X : R -> nat -> R) (dX : nat -> R) t : (forall e, In e es -> (tgt e < n)%nat /\ (src e < n)%nat) ->
  (forall j, (j < n)%nat -> is_derive (fun u => X u j) t (dX j)) -> is_derive (fun u => lap es (X u) i) t (lap es dX i).
Proof.
  intros Hr H. unfold lap. induction es as [|e es IH]; simpl; [apply (is_derive_const 0)|].
  apply (is_derive_plus (fun u => lap_edge i (X u) e) (fun u => fold_right (fun e a => lap_edge i (X u) e + a) 0 es));
    [|apply IH; intros; apply Hr; right; assumption].
  unfold lap_edge. destruct (Hr e ltac:(left; reflexivity)) as [Rt Rs].
  destruct (Nat.eqb_spec (tgt e) i) as [<-|]; [|apply (is_derive_const 0)].
  apply (is_derive_minus (fun u => Rabs (Q2R (wt e)) * X u (tgt e)) (fun u => Q2R (wt e) * X u (src e)));
    [apply (is_derive_scal (fun u => X u (tgt e)))|apply (is_derive_scal (fun u => X u (src e)))]; apply H; assumption.
Qed.
Lemma continuous_lap n es i (X : R -> nat -> R) t : (forall e, In e es -> (tgt e < n)%nat /\ (src e < n)%nat) ->
  (forall j, (j < n)%nat -> continuous (fun u => X u j) t) -> continuous (fun u => lap es (X u) i) t.
Proof.
  intros Hr H. unfold lap. induction es as [|e es IH]; simpl; [apply continuous_const|].
  apply (continuous_plus (fun u => lap_edge i (X u) e) (fun u => fold_right (fun e a => lap_edge i (X u) e + a) 0 es));
    [|apply IH; intros; apply Hr; right; assumption].
  unfold lap_edge. destruct (Hr e ltac:(left; reflexivity)) as [Rt Rs].
  destruct (Nat.eqb_spec (tgt e) i) as [<-|]; [|apply continuous_const].
  apply (continuous_minus (fun u => Rabs (Q2R (wt e)) * X u (tgt e)) (fun u => Q2R (wt e) * X u (src e))).
  - apply (continuous_mult (fun _ => Rabs (Q2R (wt e))) (fun u => X u (tgt e))); [apply continuous_const|apply H; assumption].
  - apply (continuous_mult (fun _ => Q2R (wt e)) (fun u => X u (src e))); [apply continuous_const|apply H; assumption].
Qed.
Lemma is_derive_squares p : forall (Z : R -> nat -> R) (dZ : nat -> R) t, (forall i, is_derive (fun u => Z u i) t (dZ i)) ->
  is_derive (fun u => qdot p (fun i => sq (Z u i))) t (2 * qdot p (fun i => Z t i * dZ i)).
Proof.
  induction p as [|a p IH]; intros Z dZ t H; simpl; [rewrite Rmult_0_r; apply (is_derive_const 0)|].
  replace (2 * _) with (Q2R a * (dZ 0%nat * Z t 0%nat + Z t 0%nat * dZ 0%nat) + 2 * qdot p (shift (fun i => Z t i * dZ i))) by ring.
  apply (is_derive_plus (fun u => Q2R a * sq (Z u 0%nat)) (fun u => qdot p (shift (fun i => sq (Z u i))))).
  - apply (is_derive_scal (fun u => sq (Z u 0%nat))). apply (is_derive_mult (fun u => Z u 0%nat) (fun u => Z u 0%nat));
      [apply H|apply H|intros; apply Rmult_comm].
  - apply (IH (fun u => shift (Z u)) (shift dZ)). intros i. apply H.
Qed.
Lemma continuous_squares p : forall (Z : R -> nat -> R) t, (forall i, continuous (fun u => Z u i) t) ->
  continuous (fun u => qdot p (fun i => sq (Z u i))) t.
Proof.
  induction p as [|a p IH]; intros Z t H; simpl; [apply continuous_const|].
  apply (continuous_plus (fun u => Q2R a * sq (Z u 0%nat)) (fun u => qdot p (shift (fun i => sq (Z u i))))).
  - apply (continuous_mult (fun _ => Q2R a)); [apply continuous_const|].
    apply (continuous_mult (fun u => Z u 0%nat) (fun u => Z u 0%nat)); apply H.
  - apply (IH (fun u => shift (Z u))). intros i. apply H.
Qed.
Lemma lap_scal es a x i : lap es (fun j => a * x j) i = a * lap es x i.
Proof. unfold lap. induction es as [|e es IH]; simpl; [ring|]. rewrite IH. unfold lap_edge. destruct (tgt e =? i)%nat; ring. Qed.

Section Decay.
Variables (n : nat) (es : list edge) (T rho1 k : R) (p : list Q) (b : R).
Hypotheses (HT : 0 < T) (H1 : 0 < rho1) (Hk : 0 < k).
Hypothesis Hr : forall e, In e es -> (tgt e < n)%nat /\ (src e < n)%nat.
Hypothesis Hb : forall x, let z := lap es x in b * qdot p (fun i => sq (z i)) <= 2 * qdot p (fun i => z i * lap es z i).
Local Notation gain := (Certificate.gain T rho1 k).
Local Notation clock := (Certificate.clock T rho1 k).
Variables (X Sl : R -> nat -> R) (t0 : R).
Hypothesis HM : motion n (lap es) T rho1 k X Sl.
Hypothesis HQ : quiet n T Sl t0.
Let W (x : nat -> R) := qdot p (fun i => sq (lap es x i)).
Let Y (u : R) : nat -> R := X (Rmax t0 u).
Let dZ (t : R) (i : nat) := - gain t * lap es (lap es (Y t)) i.
Theorem weighted_decay t : t0 <= t < T -> W (X t) <= exp (- (b * (clock t - clock t0))) * W (X t0).
Proof.
  intros Ht. destruct HQ as [H0 _].
  assert (YD : forall t, t0 < t < T -> forall i, is_derive (fun u => lap es (Y u) i) t (dZ t i)).
  { intros u Hu i. unfold dZ. rewrite <- lap_scal. apply (is_derive_lap n); [exact Hr|]. intros j Hj.
    replace (- gain u * lap es (Y u) j) with (- (gain u * lap es (X (Rmax t0 u)) j)) by (unfold Y; ring).
    apply (Y_derive n (lap es) T rho1 k X Sl t0 HM HQ); assumption. }
  assert (YC : forall t, t0 <= t < T -> forall i, continuous (fun u => lap es (Y u) i) t).
  { intros u Hu i. apply (continuous_lap n); [exact Hr|]. intros j Hj.
    apply (Y_cont n (lap es) T rho1 k X Sl t0 HM HQ); assumption. }
  assert (K : exp (b * clock t) * W (Y t) <= exp (b * clock t0) * W (Y t0)).
  { apply (decreasing T t0 (fun t => exp (b * clock t) * W (Y t))
      (fun t => (b * gain t * exp (b * clock t)) * W (Y t)
        + exp (b * clock t) * (2 * qdot p (fun i => lap es (Y t) i * dZ t i)))); [| | |assumption]; clear t Ht; intros t Ht.
    - apply (is_derive_mult (fun t => exp (b * clock t)) (fun t => W (Y t))).
      + evar_last. { apply is_derive_comp; [apply is_derive_exp|]. apply is_derive_scal. apply clock_derive; lra. }
        unfold scal; simpl; unfold mult; simpl. ring.
      + apply (is_derive_squares p (fun u => lap es (Y u))). apply YD. lra.
      + intros; apply Rmult_comm.
    - apply (continuous_mult (fun t => exp (b * clock t)) (fun t => W (Y t))).
      + apply @ex_derive_continuous. eexists. apply is_derive_comp; [apply is_derive_exp|].
        apply is_derive_scal. apply clock_derive; lra.
      + apply (continuous_squares p (fun u => lap es (Y u))). apply YC. lra.
    - assert (E : qdot p (fun i => lap es (Y t) i * dZ t i) = - gain t * qdot p (fun i => lap es (Y t) i * lap es (lap es (Y t)) i)).
      { rewrite <- qdot_scal. apply qdot_ext. intros i _. unfold dZ. ring. }
      rewrite E. pose proof (Hb (Y t)) as B. cbv zeta in B. fold (W (Y t)) in B.
      pose proof (gain_pos T rho1 k H1 Hk t ltac:(lra)) as G. pose proof (exp_pos (b * clock t)) as P.
      set (q := qdot p _) in *. assert (0 <= exp (b * clock t) * gain t) by (apply Rmult_le_pos; lra). nra. }
  unfold Y in K. rewrite !Rmax_right in K by lra.
  apply (Rmult_le_reg_l (exp (b * clock t))); [apply exp_pos|].
  rewrite <- Rmult_assoc, <- exp_plus. replace (b * clock t + - (b * (clock t - clock t0))) with (b * clock t0) by ring.
  exact K.
Qed.
End Decay.

(** * The check of one Lyapunov function *)
Definition check_weighted (c : cert) (outer : list edge) (d : list Q) (gamma : nat -> Z) (K : Z) (f : func) : bool :=
  let E := listens (edges c) in
  match ly f, deviation f, constants f with
  | Weighted p, None, None => check_rows (order c) (edges c) outer p d (rate f) gamma K &&
      pos (lowest f) && Qeq_bool (overshoot f * lowest f) (highest f) &&
      forallb (fun a : nat * Q => if (get E (fst a) =? 0)%Z then Qeq_bool (snd a) 0
        else Qle_bool (lowest f) (snd a) && Qle_bool (snd a) (highest f)) (combine (seq 0 (order c)) p)
  | _, _, _ => false end.

Lemma in_combine_seq (l : list Q) : forall k m i, (i < length l)%nat -> (i < m)%nat ->
  In ((k + i)%nat, nth i l 0%Q) (combine (seq k m) l).
Proof.
  induction l as [|a l IH]; intros k [|m] [|j] Hl Hm; simpl in *; try lia.
  - left. rewrite Nat.add_0_r. reflexivity.
  - right. replace (k + S j)%nat with (S k + j)%nat by lia. apply IH; lia.
Qed.
Lemma norm2_fsum n x : norm2 n x = fsum (seq 0 n) (fun i => sq (x i)).
Proof. reflexivity. Qed.
Section Function.
Variables (c : cert) (outer : list edge) (d : list Q) (gamma : nat -> Z) (K : Z) (f : func) (p : list Q).
Hypothesis Hedges : forall e, In e (edges c) -> (tgt e < order c)%nat /\ (src e < order c)%nat.
Hypothesis Hprot : check_protocol c = true.
Hypothesis Houter : forall e, In e outer -> In e (edges c).
Hypothesis Hp : ly f = Weighted p.
Hypothesis H : check_weighted c outer d gamma K f = true.
Hypothesis Hinner : forall x, let z := lap (edges c) x in
  fsum (seq 0 (order c)) (fun i => IZR (gamma i) / IZR K * (Q2R (nth i p 0%Q) * sq (z i))) + 2 * esum outer (half_edge p z)
    <= 2 * esum (edges c) (half_edge p z).
Lemma weighted_ok : decay_claim c f.
Proof.
  intros X Sl t0 t HX q V' N off Ht. unfold check_weighted in H. rewrite Hp in H.
  destruct (deviation f) eqn:Ed; [discriminate|]. destruct (constants f) eqn:Ec; [discriminate|].
  apply andb_prop in H as [H' H4]. apply andb_prop in H' as [H' H3]. apply andb_prop in H' as [H1 H2].
  destruct (rows_parts _ _ _ _ _ _ _ _ H1) as [_ [_ [_ [_ [Lp _]]]]].
  destruct (T_pos c Hprot) as [P1 [P2 P3]]. destruct HX as [[HM _] HQ].
  pose proof (weighted_decay (order c) (edges c) _ _ _ p (Q2R (rate f)) P1 P2 P3 Hedges
    (fun x => rows_ok _ _ _ _ _ _ _ _ Hedges Houter H1 x (Hinner x)) X Sl t0 HM HQ t Ht) as D.
  assert (EV : forall x, V (edges c) (ly f) x = qdot p (fun i => sq (lap (edges c) x i))) by (intros x; rewrite Hp; reflexivity).
  assert (EN : forall x, N x = norm2 (order c) (lap (edges c) x)) by (intros x; unfold N; rewrite Hp; reflexivity).
  assert (L0 : 0 < Q2R (lowest f)) by (exact (Qpos _ H2)).
  assert (Q0 : 0 < q) by apply exp_pos.
  assert (B : forall x, Q2R (lowest f) * N x <= V' x /\ V' x <= Q2R (highest f) * N x).
  { intros x. unfold V'. rewrite EV, EN, qdot_fsum, Lp, norm2_fsum, <- !fsum_scal. rewrite forallb_forall in H4.
    assert (G : forall i, In i (seq 0 (order c)) -> let a := Q2R (nth i p 0%Q) in
      Q2R (lowest f) * sq (lap (edges c) x i) <= a * sq (lap (edges c) x i) <= Q2R (highest f) * sq (lap (edges c) x i)).
    { intros i Hi a. apply in_seq in Hi. specialize (H4 _ (in_combine_seq p 0 (order c) i ltac:(lia) ltac:(lia))). cbn [fst snd] in H4. rewrite Nat.add_0_l in H4.
      pose proof (sq_pos (lap (edges c) x i)) as S0. destruct (Z.eqb_spec (get (listens (edges c)) i) 0) as [E|_].
      - rewrite (quiet_node (edges c) x i E). unfold sq. lra.
      - apply andb_prop in H4 as [A1 A2]. apply Qle_bool_iff, Qle_Rle in A1, A2. fold a in A1, A2.
        split; apply Rmult_le_compat_r; assumption. }
    split; apply fsum_le; intros i Hi; apply G; exact Hi. }
  assert (DV : V' (X t) <= q * V' (X t0)) by (unfold V'; rewrite !EV; exact D).
  split; [exact DV|]. split; [|split].
  - destruct (B (X t)) as [A _]. destruct (B (X t0)) as [_ A'].
    apply Qeq_bool_eq, Qeq_eqR in H3. rewrite Q2R_mult in H3.
    apply (Rmult_le_reg_l (Q2R (lowest f))); [exact L0|]. eapply Rle_trans; [exact A|]. eapply Rle_trans; [exact DV|].
    replace (Q2R (lowest f) * (Q2R (overshoot f) * (q * N (X t0)))) with (q * (Q2R (overshoot f) * Q2R (lowest f) * N (X t0))) by ring.
    rewrite H3. apply Rmult_le_compat_l; [lra|exact A'].
  - intros a cs E. discriminate.
  - intros cs i E. discriminate.
Qed.
Lemma whole_weighted_ok : function_claim c f.
Proof.
  split; [apply weighted_ok|]. split; [|intros P z E; rewrite Hp in E; discriminate].
  unfold check_weighted in H. rewrite Hp in H. destruct (deviation f); [discriminate|]. destruct (constants f); [discriminate|].
  apply andb_prop in H as [H' _]. apply andb_prop in H' as [H' _]. apply andb_prop in H' as [_ H2]. exact (Qpos _ H2).
Qed.
End Function.
