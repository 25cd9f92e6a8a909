(** Weak components, the hypotheses of theorems and corollaries, and how far from 0 an agent can end. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia Psatz.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound.
Open Scope R_scope.

Definition mkwv (sw sv : Z) (p : nat * (list Q * list Q)) : vec * vec :=
  (map (scaled sw) (fst (snd p)), map (scaled sv) (snd (snd p))).
(** a sum of values, each within [M] or of weight 0, against the sum of the sizes of the weights *)
Lemma bound_gen sw sv l i x M : (0 < sw)%Z -> 0 <= M -> (forall p, In p l -> good sw (fst (snd p)) = true) ->
  (forall p, In p l -> nth i (map (scaled sw) (fst (snd p))) 0%Z = 0%Z \/ Rabs (qdot (snd (snd p)) x) <= M) ->
  IZR sw * Rabs (fold_right (fun b a => Q2R (nth i (fst (snd b)) 0%Q) * qdot (snd (snd b)) x + a) 0 l)
  <= IZR (fold_right (fun p a => (Z.abs (nth i (fst p) 0%Z) + a)%Z) 0%Z (map (mkwv sw sv) l)) * M.
Proof.
  intros Hs HM H B. apply IZR_lt in Hs. induction l as [|p l IH]; simpl; [rewrite Rabs_R0; lra|].
  specialize (IH ltac:(intros; apply H; right; assumption) ltac:(intros; apply B; right; assumption)).
  specialize (B p ltac:(left; reflexivity)). pose proof (H p ltac:(left; reflexivity)) as G.
  assert (K : IZR sw * Rabs (Q2R (nth i (fst (snd p)) 0%Q)) * Rabs (qdot (snd (snd p)) x)
    <= IZR (Z.abs (nth i (map (scaled sw) (fst (snd p))) 0%Z)) * M).
  { rewrite abs_IZR, nth_scaled by exact G. rewrite Rabs_mult, (Rabs_right (IZR sw)) by lra.
    destruct B as [B|B].
    - pose proof (nth_scaled sw (fst (snd p)) i G) as N. rewrite B in N. symmetry in N. apply Rmult_integral in N as [N|N]; [lra|].
      rewrite N, Rabs_R0. lra.
    - apply Rmult_le_compat_l; [|exact B]. apply Rmult_le_pos; [lra|apply Rabs_pos]. }
  rewrite plus_IZR. eapply Rle_trans; [apply Rmult_le_compat_l; [lra|apply Rabs_triang]|]. rewrite Rabs_mult. lra.
Qed.

(** * Paths along edges in either direction *)
Lemma linked_back es i j : linked es i j -> linked es j i.
Proof.
  intros H. apply path_swap. unfold linked in H. rewrite map_app, map_map. induction H as [i|i e He P IH]; [constructor|].
  apply path_step; [|exact IH]. apply in_app_iff in He as [He|He]; apply in_app_iff.
  - right. apply in_map_iff. exists e. split; [destruct e; reflexivity|exact He].
  - left. exact He.
Qed.
Lemma linked_in es C : forallb (fun e => Bool.eqb (mem (src e) C) (mem (tgt e) C)) es = true ->
  forall i j, linked es i j -> In i C -> In j C.
Proof.
  intros H i j P Hi. rewrite forallb_forall in H. induction P as [i|i e He P IH]; [exact Hi|]. specialize (IH Hi).
  apply mem_In. apply mem_In in IH. apply in_app_iff in He as [He|He].
  - specialize (H e He). apply eqb_prop in H. congruence.
  - apply in_map_iff in He as [f [<- Hf]]. specialize (H f Hf). apply eqb_prop in H. simpl in *. congruence.
Qed.

(** * Hypotheses *)
Lemma check_balance_ok es C b : check_balance es C b = true -> balance_claim es C b.
Proof. destruct b as [g|cy]; intros H; [apply check_gauge_ok; exact H|exact (check_cycle_ok es C cy H)]. Qed.
Lemma twin_ok e f : twin e f = true <-> src f = tgt e /\ tgt f = src e.
Proof. unfold twin. rewrite andb_true_iff, !Nat.eqb_eq. reflexivity. Qed.
Lemma negative_ok q : (0 <? Qnum q)%Z = true <-> (0 < q)%Q.
Proof. rewrite Z.ltb_lt. unfold Qlt. simpl. lia. Qed.
Lemma undirected_ok es C : check_undirected es C = true <-> forall e, In e es -> In (tgt e) C ->
  exists f, In f es /\ src f = tgt e /\ tgt f = src e /\ (wt f == wt e)%Q.
Proof.
  unfold check_undirected. rewrite forallb_forall. split; intros H e He.
  - intros Ht. specialize (H e He). apply mem_In in Ht. rewrite Ht in H. simpl in H. apply existsb_exists in H as [f [Hf H]].
    apply andb_prop in H as [H1 H2]. apply twin_ok in H1. exists f. apply Qeq_bool_eq in H2. tauto.
  - destruct (mem (tgt e) C) eqn:M; [|reflexivity]. simpl. apply mem_In in M. destruct (H e He M) as [f [Hf [H1 [H2 H3]]]].
    apply existsb_exists. exists f. split; [exact Hf|]. apply andb_true_intro. split; [apply twin_ok; auto|apply Qeq_bool_iff; exact H3].
Qed.
Lemma cooperative_ok es C : check_cooperative es C = true <-> forall e, In e es -> In (tgt e) C -> (0 < wt e)%Q.
Proof.
  unfold check_cooperative. rewrite forallb_forall. split; intros H e He.
  - intros Ht. specialize (H e He). apply mem_In in Ht. rewrite Ht in H. apply negative_ok. exact H.
  - destruct (mem (tgt e) C) eqn:M; [|reflexivity]. apply negative_ok. apply H; [exact He|apply mem_In; exact M].
Qed.
Lemma symmetric_ok es : check_symmetric es = true <-> forall e f, In e es -> In f es -> src f = tgt e -> tgt f = src e ->
  (0 < wt e * wt f)%Q.
Proof.
  unfold check_symmetric. rewrite forallb_forall. split.
  - intros H e f He Hf E1 E2. specialize (H e He). rewrite forallb_forall in H. specialize (H f Hf).
    assert (T : twin e f = true) by (apply twin_ok; split; assumption). rewrite T in H. apply negative_ok. exact H.
  - intros H e He. apply forallb_forall. intros f Hf. destruct (twin e f) eqn:T; [|reflexivity]. apply twin_ok in T as [T1 T2].
    apply (proj2 (negative_ok (wt e * wt f))). apply H; auto.
Qed.
Lemma row_ok P l : check_row P l = true -> l <> [] /\ row P = match l with
  | [C] => if forallb (fun i => mem i (nodes C)) (members P) then 1%nat else 2%nat | _ => 3%nat end.
Proof.
  unfold check_row. intros H. apply andb_prop in H as [H1 H2]. split; [intros ->; discriminate|].
  apply Nat.eqb_eq. exact H2.
Qed.
Lemma same_truth a b P : Bool.eqb a b = true -> (b = true <-> P) -> (a = true <-> P).
Proof. intros H. apply eqb_prop in H. subst a. tauto. Qed.

Section Claims.
Variable c : cert.
Let d := prepare c.
Hypothesis Hsw : (0 < dsw d)%Z.
Hypothesis Hgood : forall p, In p (balanced_comps (comps c)) -> good (dsw d) (fst (snd p)) = true.
Hypothesis Hsum : forall i, (i < order c)%nat ->
  (fold_right (fun p a => Z.abs (nth i (fst p) 0) + a) 0 (dwv d) <= dsw d)%Z.

Lemma in_kernel p : In p (balanced_comps (comps c)) -> In (fst p, map (scaled (dsw d)) (fst (snd p))) (dfw d).
Proof.
  change (dfw d) with (combine (map fst (balanced_comps (comps c)))
    (map fst (map (mkwv (dsw d) (dsv d)) (balanced_comps (comps c))))).
  generalize (dsw d) as a, (dsv d) as b. intros a b. clear Hgood. induction (balanced_comps (comps c)) as [|q l IH]; intros H; [destruct H|].
  destruct H as [->|H]; [left; reflexivity|right; apply IH; exact H].
Qed.
Lemma piece_ok P : check_piece c d P = true -> piece_claim c P.
Proof.
  unfold check_piece. cbv zeta. set (C := members P). set (es := edges c). intros H.
  apply andb_prop in H as [H H9]. apply andb_prop in H as [H H8]. apply andb_prop in H as [H H7]. apply andb_prop in H as [H H6].
  apply andb_prop in H as [H H5]. apply andb_prop in H as [H H4]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  unfold piece_claim. fold C es. split; [|split; [|split; [|split; [|split; [|split; [|split]]]]]].
  - assert (K : forall j, In j C -> linked es (hd O C) j).
    { intros j Hj. rewrite forallb_forall in H2. specialize (H2 j Hj). apply mem_In, reach_ok in H2 as [s [[<-|[]] L]]. exact L. }
    intros i j Hi. split.
    + intros Hj. apply (path_trans _ i (hd O C) j); [apply linked_back; apply K; exact Hi|apply K; exact Hj].
    + intros L. exact (linked_in es C H3 i j L Hi).
  - apply (row_ok _ _ H4).
  - apply (row_ok _ _ H4).
  - apply eqb_prop. exact H5.
  - apply (same_truth _ _ _ H6). apply undirected_ok.
  - apply (same_truth _ _ _ H7). apply cooperative_ok.
  - apply check_balance_ok. exact H8.
  - intros x M i HM B Hi Hn. rewrite forallb_forall in H9. specialize (H9 i Hi). rewrite forallb_forall in H9.
    pose proof (bound_gen (dsw d) (dsv d) (balanced_comps (comps c)) i x M Hsw HM Hgood) as G. fold (end_state c x i) in G.
    assert (S : IZR (dsw d) * Rabs (end_state c x i) <= IZR (dsw d) * M).
    { eapply Rle_trans; [apply G|].
      - intros p Hp. specialize (H9 _ (in_kernel p Hp)). cbn [fst snd] in H9. apply orb_prop in H9 as [H9|H9].
        + right. unfold balanced_comps in Hp. apply in_map_iff in Hp as [D [<- HD]]. apply filter_In in HD as [HD W].
          cbn [fst snd] in *. apply (B D); [|exact W]. unfold own. apply filter_In. split; [exact HD|exact H9].
        + left. apply Z.eqb_eq. exact H9.
      - apply Rmult_le_compat_r; [exact HM|]. apply IZR_le. exact (Hsum i Hn). }
    apply IZR_lt in Hsw. apply (Rmult_le_reg_l (IZR (dsw d))); assumption.
Qed.
Lemma claims_of_check : check_claims c d = true -> claims c.
Proof.
  unfold check_claims. intros H. apply andb_prop in H as [H H4]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  rewrite forallb_forall in H1, H2. split; [|split; [|split]].
  - intros P HP. apply piece_ok. auto.
  - intros i Hi. specialize (H2 i ltac:(apply in_seq; lia)). apply existsb_exists in H2 as [P [HP H2]]. exists P.
    split; [exact HP|apply mem_In; exact H2].
  - apply check_balance_ok. exact H3.
  - apply (same_truth _ _ _ H4). apply symmetric_ok.
Qed.
End Claims.
