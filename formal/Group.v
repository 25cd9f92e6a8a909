(** Leader groups of graphs of many nodes: each is proved by itself, as a graph of its own nodes, by a dense form. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Margin Mean Table Dominance.
Open Scope R_scope.

(** * The check *)
Fixpoint index (i : nat) (C : list nat) : nat := match C with [] => O | j :: C' => if (i =? j)%nat then O else S (index i C') end.
Definition inside_of (C : list nat) (e : edge) : edge := Edge (index (tgt e) C) (index (src e) C) (wt e).
Fixpoint ascending (C : list nat) : bool :=
  match C with a :: C' => match C' with b :: _ => (a <? b)%nat && ascending C' | [] => true end | [] => true end.
(** [2 z' diag(p) L z >= g z' diag(p) z] for [z = L x]; [gauge]: of a balanced group *)
Definition check_form_of (m : nat) (es : list edge) (gauge : option (list Z)) (p : list Q) (g : Q) : bool :=
  let ls := common (map wt es) in let L := lmat ls es m in
  match form m ls L (InE (diagonal_matrix p)) with
  | Some (F, _) => good ls (map wt es) &&
      nonneg m 1 (match gauge with Some c => [(O, c)] | None => [] end) (rate_form ls L F g)
  | None => false end.
Definition check_group (own : list edge) (C : list nat) (b : balance) (p : list Q) (g : Q) : bool :=
  match own with [] => true | _ =>
    ascending C && forallb (fun e => mem (src e) C) own &&
    check_form_of (length C) (map (inside_of C) own) (match b with Gauge c => Some (map (fun i => nth i c 0%Z) C) | Cycle _ => None end)
      (map (fun i => nth i p 0%Q) C) g end.

(** * One group *)
Lemma form_of_ok m es gauge p g : check_form_of m es gauge p g = true -> forall x, let z := lap es x in
  Q2R g * qdot p (fun i => sq (z i)) <= 2 * qdot p (fun i => z i * lap es z i).
Proof.
  unfold check_form_of. cbv zeta. set (ls := common (map wt es)). intros H x.
  destruct (form m ls (lmat ls es m) (InE (diagonal_matrix p))) as [[F f]|] eqn:EF; [|discriminate].
  apply andb_prop in H as [G H]. destruct (form_ok m ls es _ _ F f G eq_refl EF) as [Hf [Hfit HV]].
  pose proof (rate_form_ok m ls es _ F g G eq_refl Hfit x (nonneg_ok _ _ _ _ H x)) as R.
  set (z := lap es x) in *. apply IZR_lt in Hf.
  assert (E : bil F z x + bil F x z = IZR f * (2 * qdot p (fun i => z i * lap es z i))).
  { assert (P : bil F (fun i => x i + z i) (fun i => x i + z i) = bil F x x + (bil F z x + bil F x z) + bil F z z)
      by (rewrite bil_plus_l, !bil_plus_r; ring).
    rewrite !HV in P. cbn [V coords] in P. rewrite !qbil_diagonal in P.
    assert (Q : qdot p (fun i => sq (lap es (fun j => x j + z j) i)) =
      qdot p (fun i => sq (lap es x i)) + 2 * qdot p (fun i => z i * lap es z i) + qdot p (fun i => sq (lap es z i))).
    { rewrite <- qdot_scal, <- !qdot_plus. apply qdot_ext. intros i _. rewrite lap_plus. unfold sq. fold (z i). ring. }
    rewrite Q in P. lra. }
  rewrite E, HV in R. cbn [V coords] in R. rewrite qbil_diagonal in R. fold z in R.
  apply (Rmult_le_reg_l (IZR f)); [exact Hf|]. lra.
Qed.
Lemma ascending_lt C : forall a, ascending (a :: C) = true -> forall i, In i C -> (a < i)%nat.
Proof.
  induction C as [|b C IH]; intros a H i Hi; [destruct Hi|]. simpl in H. apply andb_prop in H as [H1 H2]. apply Nat.ltb_lt in H1.
  destruct Hi as [<-|Hi]; [exact H1|]. specialize (IH b H2 i Hi). lia.
Qed.
Lemma ascending_NoDup C : ascending C = true -> NoDup C.
Proof.
  induction C as [|a C IH]; intros H; [constructor|]. constructor.
  - intros K. pose proof (ascending_lt C a H a K). lia.
  - apply IH. destruct C as [|b C]; [reflexivity|]. simpl in H. apply andb_prop in H. tauto.
Qed.
Lemma index_ok i C : In i C -> (index i C < length C)%nat /\ nth (index i C) C O = i.
Proof.
  induction C as [|j C IH]; intros H; [destruct H|]. simpl. destruct (Nat.eqb_spec i j) as [->|N]; [split; [lia|reflexivity]|].
  destruct H as [H|H]; [congruence|]. destruct (IH H). split; [lia|assumption].
Qed.
Lemma index_nth C : NoDup C -> forall j, (j < length C)%nat -> index (nth j C O) C = j.
Proof.
  intros N j Hj. destruct (index_ok (nth j C O) C (nth_In _ _ Hj)) as [A B]. apply (proj1 (NoDup_nth C O) N); assumption.
Qed.
Lemma fsum_nth C (f : nat -> R) : fsum (seq 0 (length C)) (fun j => f (nth j C O)) = fsum C f.
Proof.
  induction C as [|a C IH]; simpl; [reflexivity|]. rewrite <- IH. f_equal. rewrite <- seq_shift.
  generalize (seq 0 (length C)). induction l as [|i l IHl]; simpl; [reflexivity|]. rewrite IHl. reflexivity.
Qed.
Lemma map_at (f : nat -> Q) C j : (j < length C)%nat -> nth j (map f C) 0%Q = f (nth j C O).
Proof.
  intros Hj. rewrite (nth_indep _ 0%Q (f O)) by (rewrite map_length; exact Hj). apply map_nth.
Qed.
Lemma lap_filter es keep x i : (forall e, In e es -> keep e = false -> tgt e <> i) -> lap (filter keep es) x i = lap es x i.
Proof.
  unfold lap. induction es as [|e es IH]; intros H; simpl; [reflexivity|].
  specialize (IH ltac:(intros; apply H; [right|]; assumption)). destruct (keep e) eqn:E; simpl; rewrite IH; [reflexivity|].
  unfold lap_edge. destruct (Nat.eqb_spec (tgt e) i) as [T|_]; [|ring]. exfalso. exact (H e (or_introl eq_refl) E T).
Qed.
Lemma lap_inside C x own : (forall e, In e own -> In (tgt e) C /\ In (src e) C) -> forall i, In i C ->
  lap (map (inside_of C) own) (fun j => x (nth j C O)) (index i C) = lap own x i.
Proof.
  intros H i Hi. unfold lap. induction own as [|e own IH]; simpl; [reflexivity|].
  rewrite IH by (intros; apply H; right; assumption). destruct (H e (or_introl eq_refl)) as [Ht Hs]. f_equal.
  destruct (index_ok _ _ Ht) as [_ Et]. destruct (index_ok _ _ Hs) as [_ Es]. destruct (index_ok _ _ Hi) as [_ Ei].
  unfold lap_edge. simpl. rewrite Es, Ei. destruct (Nat.eqb_spec (tgt e) i) as [->|N]; [rewrite Nat.eqb_refl; reflexivity|].
  destruct (Nat.eqb_spec (index (tgt e) C) (index i C)) as [K|_]; [|reflexivity]. exfalso. apply N. rewrite <- Et, <- Ei, K. reflexivity.
Qed.
(** [own]: the edges into [C], from [es] *)
Lemma group_ok es own C b p g x : (forall i, In i C -> forall y, lap own y i = lap es y i) ->
  (forall e, In e own -> In (tgt e) C) -> check_group own C b p g = true -> let z := lap es x in
  Q2R g * fsum C (fun i => Q2R (nth i p 0%Q) * sq (z i)) <= 2 * esum own (half_edge p z).
Proof.
  intros HL HT H z. unfold check_group in H. destruct own as [|e0 l0] eqn:Eo.
  - simpl. rewrite Rmult_0_r. rewrite (fsum_ext C _ (fun _ => 0 * 1)); [rewrite fsum_scal; lra|].
    intros i Hi. unfold z. rewrite <- (HL i Hi x). unfold lap. simpl. unfold sq. ring.
  - rewrite <- Eo in *. clear Eo e0 l0. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2]. rewrite forallb_forall in H2.
    pose proof (ascending_NoDup C H1) as N.
    assert (Both : forall e, In e own -> In (tgt e) C /\ In (src e) C) by (intros e He; split; [apply HT; exact He|apply mem_In; apply H2; exact He]).
    set (x' := fun j => x (nth j C O)). pose proof (form_of_ok _ _ _ _ _ H3 x') as R. cbv zeta in R. set (p' := map _ C) in R.
    set (z' := lap (map (inside_of C) own) x') in R.
    assert (Ez : forall i, In i C -> z' (index i C) = z i).
    { intros i Hi. unfold z', x', z. rewrite (lap_inside C x own Both i Hi). apply HL. exact Hi. }
    rewrite (qdot_mult p' z' z') in R. rewrite qdot_fsum in R. unfold p' at 1 in R. rewrite map_length in R.
    rewrite (fsum_ext _ _ (fun j => (fun i => Q2R (nth i p 0%Q) * sq (z i)) (nth j C O))) in R.
    2: { intros j Hj. apply in_seq in Hj. cbv beta. unfold p'. rewrite map_at by lia.
         rewrite <- (index_nth C N j) at 2 by lia. rewrite Ez by (apply nth_In; lia). reflexivity. }
    rewrite (fsum_nth C (fun i => Q2R (nth i p 0%Q) * sq (z i))) in R. eapply Rle_trans; [exact R|]. apply Req_le. f_equal.
    clear R H2 H3. clearbody z' z. clear - Both Ez. induction own as [|e l IH]; simpl; [reflexivity|].
    rewrite IH by (intros g' Hg'; apply Both; right; exact Hg'). f_equal.
    destruct (Both e (or_introl eq_refl)) as [Ht Hs]. destruct (index_ok _ _ Ht) as [It Et].
    unfold half_edge, p', inside_of. cbn [tgt src wt]. rewrite map_at by exact It. rewrite Et, !Ez by assumption. reflexivity.
Qed.

(** * All groups *)
Lemma key_filter key es i : from_ (by_key key es) i = filter (fun e => (key e =? i)%nat) es.
Proof.
  induction es as [|f es IH].
  - unfold from_, by_key. cbn [fold_right]. rewrite Table.F.empty_o. reflexivity.
  - change (by_key key (f :: es)) with (M.add (key f) (f :: from_ (by_key key es) (key f)) (by_key key es)).
    unfold from_ at 1. rewrite Table.F.add_o. simpl filter. destruct (OrderedTypeEx.Nat_as_OT.eq_dec (key f) i) as [E|N].
    + rewrite E, IH, Nat.eqb_refl. reflexivity.
    + destruct (Nat.eqb_spec (key f) i); [contradiction|]. rewrite <- IH. reflexivity.
Qed.
Lemma parts_of len key es f : (forall e, In e es -> (key e <= len)%nat) ->
  esum es f = esum (filter (fun e => (key e =? 0)%nat) es) f + fsum (seq 0 len) (fun k => esum (filter (fun e => (key e =? S k)%nat) es) f).
Proof.
  induction es as [|e es IH]; intros H; simpl.
  - rewrite (fsum_ext _ _ (fun _ => 0 * 1)) by (intros; ring). rewrite fsum_scal. ring.
  - rewrite IH by (intros; apply H; right; assumption). pose proof (H e (or_introl eq_refl)) as K.
    rewrite (fsum_ext (seq 0 len) (fun k => esum (if (key e =? S k)%nat then e :: filter (fun e => (key e =? S k)%nat) es else filter (fun e => (key e =? S k)%nat) es) f)
      (fun k => (if (key e =? S k)%nat then f e else 0) + esum (filter (fun e => (key e =? S k)%nat) es) f))
      by (intros k _; destruct (key e =? S k)%nat; simpl; ring).
    rewrite fsum_plus. destruct (key e) as [|q] eqn:E; simpl.
    + rewrite (fsum_ext _ (fun _ => 0) (fun _ => 0 * 1)) by (intros; ring). rewrite fsum_scal. ring.
    + rewrite (fsum_at len 0 q (fun _ => f e)) by lia. ring.
Qed.
Lemma fsum_swap l l' (f : nat -> nat -> R) : fsum l (fun i => fsum l' (f i)) = fsum l' (fun k => fsum l (fun i => f i k)).
Proof.
  induction l as [|i l IH]; simpl.
  - rewrite (fsum_ext _ _ (fun _ => 0 * 1)) by (intros; ring). rewrite fsum_scal. ring.
  - rewrite IH. symmetry. apply fsum_plus.
Qed.
Lemma fsum_members n C f : NoDup C -> (forall i, In i C -> (i < n)%nat) -> fsum (seq 0 n) (fun i => if mem i C then f i else 0) = fsum C f.
Proof.
  induction C as [|a C IH]; intros N H; simpl.
  - rewrite (fsum_ext _ _ (fun _ => 0 * 1)) by (intros; ring). rewrite fsum_scal. ring.
  - inversion N; subst. rewrite <- IH, <- (fsum_at n 0 a f) by (auto; try (intros; apply H; right; assumption); specialize (H a (or_introl eq_refl)); lia).
    rewrite <- fsum_plus. apply fsum_ext. intros i _. rewrite (Nat.eqb_sym a i). destruct (Nat.eqb_spec i a) as [->|Ne]; simpl.
    + destruct (mem a C) eqn:E; [apply mem_In in E; contradiction|ring].
    + destruct (mem i C); ring.
Qed.
Section Groups.
Variables (n : nat) (es : list edge) (Cs : list (list nat)) (gs : list Q) (p : list Q).
Let pl := places Cs.
Hypothesis Hapart : apart 0 Cs pl = true.
Hypothesis Hasc : forall C, In C Cs -> ascending C = true.
Hypothesis Hn : forall C i, In C Cs -> In i C -> (i < n)%nat.
Let own k := filter (fun e => (number pl e =? S k)%nat) es.
Variable x : nat -> R.
Let z := lap es x.
Hypothesis Hgroup : forall k, (k < length Cs)%nat ->
  Q2R (nth k gs 0%Q) * fsum (nth k Cs []) (fun i => Q2R (nth i p 0%Q) * sq (z i)) <= 2 * esum (own k) (half_edge p z).
Definition gamma_of (i : nat) : R := match M.find i pl with Some k => Q2R (nth k gs 0%Q) | None => 0 end.
Lemma groups_ok : fsum (seq 0 n) (fun i => gamma_of i * (Q2R (nth i p 0%Q) * sq (z i)))
  + 2 * esum (filter (fun e => (number pl e =? 0)%nat) es) (half_edge p z) <= 2 * esum es (half_edge p z).
Proof.
  assert (Hnum : forall e, In e es -> (number pl e <= length Cs)%nat).
  { intros e _. unfold number. destruct (M.find (tgt e) pl) as [k|] eqn:E; [|lia]. apply places_some in E. lia. }
  rewrite (parts_of (length Cs) (number pl) es _ Hnum). fold (own : nat -> list edge). set (phi := fun i => Q2R (nth i p 0%Q) * sq (z i)).
  assert (G : fsum (seq 0 n) (fun i => gamma_of i * phi i) = fsum (seq 0 (length Cs)) (fun k => Q2R (nth k gs 0%Q) * fsum (nth k Cs []) phi)).
  { rewrite (fsum_ext _ _ (fun i => fsum (seq 0 (length Cs)) (fun k => if mem i (nth k Cs []) then Q2R (nth k gs 0%Q) * phi i else 0))).
    2: { intros i _. unfold gamma_of. destruct (M.find i pl) as [k|] eqn:E.
         - destruct (places_some _ _ _ E) as [Hk Hi]. rewrite <- (fsum_at (length Cs) 0 k (fun k => Q2R (nth k gs 0%Q) * phi i)) by lia.
           apply fsum_ext. intros j Hj. apply in_seq in Hj. rewrite <- (within_mem Cs j i Hapart) by lia. unfold within. fold pl. rewrite E. reflexivity.
         - rewrite Rmult_0_l. rewrite (fsum_ext _ _ (fun _ => 0 * 1)); [rewrite fsum_scal; ring|].
           intros j Hj. apply in_seq in Hj. rewrite <- (within_mem Cs j i Hapart) by lia. unfold within. fold pl. rewrite E. ring. }
    rewrite fsum_swap. apply fsum_ext. intros k Hk. apply in_seq in Hk. assert (HC : In (nth k Cs []) Cs) by (apply nth_In; lia).
    rewrite <- (fsum_members n (nth k Cs []) phi) by (try (apply ascending_NoDup; apply Hasc; exact HC); intros i Hi; apply (Hn _ _ HC Hi)).
    rewrite <- fsum_scal. apply fsum_ext. intros i _. destruct (mem i (nth k Cs [])); ring. }
  change (fun i => gamma_of i * (Q2R (nth i p 0%Q) * sq (z i))) with (fun i => gamma_of i * phi i). rewrite G.
  assert (B : fsum (seq 0 (length Cs)) (fun k => Q2R (nth k gs 0%Q) * fsum (nth k Cs []) phi) <=
    2 * fsum (seq 0 (length Cs)) (fun k => esum (own k) (half_edge p z))).
  { rewrite <- fsum_scal. apply fsum_le. intros k Hk. apply in_seq in Hk. apply Hgroup. lia. }
  change (fun k => esum (filter (fun e => (number pl e =? S k)%nat) es) (half_edge p z)) with (fun k => esum (own k) (half_edge p z)). lra.
Qed.
End Groups.
