(** Structure and claims of graphs of many nodes: what [Graph.v] and [Claims.v] decide by lists, by maps, edge by edge. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia Psatz.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Claims Table.
Open Scope nat_scope.

(** * The check *)
Definition gauge_table (C : list nat) (g : list Z) : nat -> Z :=
  match C with [_] => fun i => nth i g 0%Z | _ => let T := table g in fun i => get T i end.
(** [own]: the edges inside [C] *)
Definition wide_balance (es own : list edge) (C : list nat) (b : balance) : bool :=
  match b with
  | Gauge g => let v := gauge_table C g in
      forallb (fun i => let a := v i in (a =? 1)%Z || (a =? -1)%Z) C &&
      forallb (fun e => 0 <? Qnum (wt e) * (v (tgt e) * v (src e)))%Z own
  | Cycle cy => check_cycle es C cy end.
Definition wide_component (n : nat) (own : list edge) (C : list nat) : bool :=
  match C with
  | [] => false | [_] => true
  | c :: _ =>
      (let F := reached n (by_source own) [c] in forallb (fun i => seen i F) C) &&
      (let B := reached n (by_source (map swap own)) [c] in forallb (fun i => seen i B) C) end.
Fixpoint numbered {A} (k : nat) (f : nat -> A -> bool) (l : list A) : bool :=
  match l with [] => true | a :: l' => f k a && numbered (S k) f l' end.
Definition wide_structure (c : cert) : bool :=
  let n := order c in let es := edges c in
  let Cs := map nodes (comps c) in let pl := places Cs in
  let into := by_key (number pl) es in
  apart 0 Cs pl && forallb (fun C => forallb (fun i => i <? n) C) Cs &&
  forallb (fun e => match M.find (tgt e) pl with Some k => within pl k (src e) | None => true end) es &&
  numbered 0 (fun k C => let own := from_ into (S k) in
    wide_component n own (nodes C) && wide_balance es own (nodes C) (camps C)) (comps c) &&
  (let R := reached n (by_source es) (map (hd 0) Cs) in forallb (fun i => seen i R) (seq 0 n)).

Fixpoint same_list (a b : list nat) : bool :=
  match a, b with [], [] => true | i :: a', j :: b' => (i =? j) && same_list a' b' | _, _ => false end.
Definition covers (P C : list nat) : bool := same_list P C || forallb (fun i => mem i C) P.
Definition wide_piece (c : cert) (by_src : ways) (pl : place) (k : nat) (own_edges : list edge) (P : piece) : bool :=
  let n := order c in let C := members P in
  let mine := filter (fun D => within pl k (hd 0 (nodes D))) (comps c) in
  (match C with [] => false | _ => true end) &&
  (let R := reached n (by_source (own_edges ++ map swap own_edges)) [hd 0 C] in forallb (fun i => seen i R) C) &&
  (match mine with [] => false | _ => true end) &&
  (row P =? match mine with [D] => if covers C (nodes D) then 1 else 2 | _ => 3 end) &&
  Bool.eqb (some_balanced P) (existsb is_balanced mine) &&
  Bool.eqb (undirected P) (forallb (fun e => existsb (fun f => twin e f && Qeq_bool (wt f) (wt e)) (from_ by_src (tgt e))) own_edges) &&
  Bool.eqb (cooperative P) (forallb (fun e => 0 <? Qnum (wt e))%Z own_edges) &&
  wide_balance (edges c) own_edges C (whole P).
Definition wide_claims (c : cert) : bool :=
  let n := order c in let es := edges c in let by_src := by_source es in
  let Ps := map members (pieces c) in let pl := places Ps in let into := by_key (number pl) es in
  apart 0 Ps pl &&
  forallb (fun e => match M.find (tgt e) pl with Some k => within pl k (src e) | None => false end) es &&
  forallb (fun i => match M.find i pl with Some _ => true | None => false end) (seq 0 n) &&
  numbered 0 (fun k P => wide_piece c by_src pl k (from_ into (S k)) P) (pieces c) &&
  wide_balance es es (seq 0 n) (all_balanced c) &&
  Bool.eqb (sign_symmetric c)
    (forallb (fun e => forallb (fun f => negb (twin e f) || (0 <? Qnum (wt e) * Qnum (wt f))%Z) (from_ by_src (tgt e))) es) &&
  forallb (fun C => match share C, null C with [], [] => true | _, _ => false end) (comps c).

(** * Lists *)
Lemma numbered_ok {A} (f : nat -> A -> bool) l d : forall k, numbered k f l = true -> forall j, j < length l -> f (k + j) (nth j l d) = true.
Proof.
  induction l as [|a l IH]; intros k H j Hj; simpl in *; [lia|]. apply andb_prop in H as [H1 H2]. destruct j as [|j].
  - rewrite Nat.add_0_r. exact H1.
  - replace (k + S j) with (S k + j) by lia. apply IH; [exact H2|lia].
Qed.
Lemma in_nth {A} (l : list A) x d : In x l -> exists j, j < length l /\ nth j l d = x.
Proof. intros H. destruct (In_nth l x d H) as [j [A1 A2]]. exists j. split; assumption. Qed.
Lemma same_list_ok a : forall b, same_list a b = true -> a = b.
Proof.
  induction a as [|i a IH]; intros [|j b] H; simpl in H; try discriminate; [reflexivity|]. apply andb_prop in H as [H1 H2].
  apply Nat.eqb_eq in H1. subst. f_equal. apply IH. exact H2.
Qed.
Lemma covers_ok P C : covers P C = forallb (fun i => mem i C) P.
Proof.
  unfold covers. destruct (same_list P C) eqn:E; [|reflexivity]. apply same_list_ok in E. subst. simpl. symmetry.
  apply forallb_forall. intros i Hi. apply mem_In. exact Hi.
Qed.
Lemma gauge_table_ok C g i : gauge_table C g i = nth i g 0%Z.
Proof. unfold gauge_table. destruct C as [|a [|b C]]; try reflexivity; apply get_table. Qed.
Lemma wide_balance_ok es own C b : (forall e, In e es -> In (src e) C -> In (tgt e) C -> In e own) ->
  wide_balance es own C b = true -> balance_claim es C b.
Proof.
  intros Ho H. destruct b as [g|cy]; [|exact (check_cycle_ok es C cy H)].
  unfold wide_balance in H. cbv zeta in H. apply andb_prop in H as [H1 H2]. rewrite forallb_forall in H1, H2. split.
  - intros i Hi. specialize (H1 i Hi). rewrite gauge_table_ok in H1. apply orb_prop in H1 as [E|E]; apply Z.eqb_eq in E; auto.
  - intros e He Hs Ht. specialize (H2 e (Ho e He Hs Ht)). rewrite !gauge_table_ok in H2. apply Z.ltb_lt in H2.
    unfold Qlt, Qmult. simpl. lia.
Qed.

(** * Structure *)
Section Structure.
Variable c : cert.
Let es := edges c.
Let n := order c.
Let Cs := map nodes (comps c).
Hypothesis H : wide_structure c = true.
Lemma wide_parts : apart 0 Cs (places Cs) = true /\ (forall C i, In C (comps c) -> In i (nodes C) -> i < n) /\
  (forall C, In C (comps c) -> closed_component es (fun i => In i (nodes C)) /\ balance_claim es (nodes C) (camps C)) /\
  forall i, i < n -> exists C, In C (comps c) /\ nodes C <> [] /\ path es (hd 0 (nodes C)) i.
Proof.
  unfold wide_structure in H. cbv zeta in H. fold es n Cs in H.
  apply andb_prop in H as [H' H5]. apply andb_prop in H' as [H' H4]. apply andb_prop in H' as [H' H3]. apply andb_prop in H' as [H1 H2].
  rewrite forallb_forall in H2, H3, H5.
  assert (Hn : forall C i, In C (comps c) -> In i (nodes C) -> i < n).
  { intros C i HC Hi. specialize (H2 (nodes C) (in_map nodes _ _ HC)). rewrite forallb_forall in H2. apply Nat.ltb_lt. auto. }
  assert (K : forall C, In C (comps c) -> nodes C <> [] /\ closed_component es (fun i => In i (nodes C)) /\ balance_claim es (nodes C) (camps C)).
  { intros C HC. destruct (in_nth (comps c) C (Comp [] (Cycle []) [] []) HC) as [k [Hk E]].
    assert (Hk' : k < length Cs) by (unfold Cs; rewrite map_length; exact Hk).
    assert (EC : nth k Cs [] = nodes C) by (unfold Cs; change (@nil nat) with (nodes (Comp [] (Cycle []) [] [])); rewrite map_nth, E; reflexivity).
    pose proof (numbered_ok _ _ (Comp [] (Cycle []) [] []) 0 H4 k Hk) as N. rewrite E, Nat.add_0_l in N. cbv zeta in N.
    set (own := from_ (by_key (number (places Cs)) es) (S k)) in N. apply andb_prop in N as [N1 N2].
    assert (Ho : forall e, In e own <-> In e es /\ In (tgt e) (nodes C)) by (intros e; unfold own; rewrite (number_In Cs es k e H1 Hk'), EC; reflexivity).
    assert (Cl : forall e, In e es -> In (tgt e) (nodes C) -> In (src e) (nodes C)).
    { intros e He Ht. specialize (H3 e He). rewrite <- EC in Ht. pose proof Ht as Ht'. apply (within_In Cs k (tgt e) H1 Hk') in Ht'.
      unfold within in Ht'. destruct (M.find (tgt e) (places Cs)) as [j|]; [|discriminate]. apply Nat.eqb_eq in Ht'. subst j.
      rewrite <- EC. apply (within_In Cs k (src e) H1 Hk'). exact H3. }
    assert (Ne : nodes C <> []) by (intros Z; rewrite Z in N1; discriminate).
    split; [exact Ne|]. split.
    - split; [destruct (nodes C) as [|a l]; [contradiction|exists a; left; reflexivity]|]. split; [exact Cl|].
      assert (P : forall i, In i (nodes C) -> path es (hd 0 (nodes C)) i /\ path es i (hd 0 (nodes C))).
      { intros i Hi. unfold wide_component in N1. destruct (nodes C) as [|a [|b l]] eqn:Ec; [destruct Hi|destruct Hi as [<-|[]]; split; constructor|].
        cbv zeta in N1. apply andb_prop in N1 as [F B]. rewrite forallb_forall in F, B. specialize (F i Hi). specialize (B i Hi).
        apply reached_ok in F as [s [[<-|[]] F]]. apply reached_ok in B as [s [[<-|[]] B]]. apply path_swap in B.
        split; [apply (path_more own)|apply (path_more own)]; try assumption; intros e He; apply Ho in He; tauto. }
      intros i j Hi Hj. apply (path_trans _ _ (hd 0 (nodes C))); [apply P; exact Hi|apply P; exact Hj].
    - apply (wide_balance_ok es own); [|exact N2]. intros e He _ Ht. apply Ho. split; assumption. }
  split; [exact H1|]. split; [exact Hn|]. split; [intros C HC; apply K; exact HC|].
  intros i Hi. specialize (H5 i ltac:(apply in_seq; lia)). apply reached_ok in H5 as [s [Hs P]].
  apply in_map_iff in Hs as [N [<- HN]]. unfold Cs in HN. apply in_map_iff in HN as [C [<- HC]].
  exists C. split; [exact HC|]. split; [apply K; exact HC|exact P].
Qed.
Theorem wide_structure_ok : structure c.
Proof.
  destruct wide_parts as [_ [_ [K R]]]. split; [intros C HC; apply K; exact HC|]. split; [|intros C HC; apply K; exact HC].
  intros D [[d Hd] [Dc Ds]] Hn. destruct (R d (Hn d Hd)) as [C [HC [Ne P]]]. destruct (K C HC) as [[_ [Cc Cs']] _].
  exists C. split; [exact HC|]. assert (D0 : D (hd 0 (nodes C))) by (eapply closed_path; eauto).
  assert (C0 : In (hd 0 (nodes C)) (nodes C)) by (destruct (nodes C); [contradiction|left; reflexivity]). intros i. split; intros Hi.
  - exact (closed_path es (fun i => In i (nodes C)) i _ Cc (Ds i _ Hi D0) C0).
  - exact (closed_path es D i _ Dc (Cs' i _ Hi C0) D0).
Qed.
End Structure.

(** * Claims *)
Lemma no_end c : (forall C, In C (comps c) -> share C = []) -> forall x i, end_state c x i = 0%R.
Proof.
  intros H x i. unfold end_state, balanced_comps.
  assert (G : forall l, (forall C, In C l -> share C = []) -> (fold_right (fun b a => Q2R (nth i (fst (snd b)) 0%Q) * qdot (snd (snd b)) x + a)%R 0%R
    (map (fun C => (hd O (nodes C), (share C, null C))) (filter is_balanced l)) = 0)%R).
  { induction l as [|C l IH]; intros Hl; simpl; [reflexivity|]. specialize (IH ltac:(intros; apply Hl; right; assumption)).
    destruct (is_balanced C); [|exact IH]. simpl. rewrite IH, (Hl C) by (left; reflexivity).
    replace (Q2R (nth i [] 0%Q)) with 0%R by (destruct i; unfold Q2R; simpl; lra). lra. }
  apply G. exact H.
Qed.
Section Claims.
Variable c : cert.
Let es := edges c.
Let n := order c.
Let Ps := map members (pieces c).
Hypothesis H : wide_claims c = true.
Theorem wide_claims_ok : claims c /\ behaviour c.
Proof.
  unfold wide_claims in H. cbv zeta in H. fold es n Ps in H.
  apply andb_prop in H as [H' H7]. apply andb_prop in H' as [H' H6]. apply andb_prop in H' as [H' H5].
  apply andb_prop in H' as [H' H4]. apply andb_prop in H' as [H' H3]. apply andb_prop in H' as [H1 H2].
  rewrite forallb_forall in H2, H3, H7.
  assert (S0 : forall C, In C (comps c) -> share C = [] /\ null C = []).
  { intros C HC. specialize (H7 C HC). destruct (share C), (null C); try discriminate; auto. }
  assert (E0 : forall x i, end_state c x i = 0%R) by (apply no_end; intros C HC; apply S0; exact HC).
  split; [|intros x C i HC _; rewrite E0; destruct (S0 C HC) as [_ ->]; destruct (camps C); simpl; lra].
  split; [|split; [|split]].
  - intros P HP. set (P0 := Piece [] 0 false false false (Cycle [])).
    destruct (in_nth (pieces c) P P0 HP) as [k [Hk E]].
    assert (Hk' : k < length Ps) by (unfold Ps; rewrite map_length; exact Hk).
    assert (EC : nth k Ps [] = members P) by (unfold Ps; change (@nil nat) with (members P0); rewrite map_nth, E; reflexivity).
    pose proof (numbered_ok _ _ P0 0 H4 k Hk) as N. rewrite E, Nat.add_0_l in N. cbv beta in N. clear H4.
    set (mine := from_ (by_key (number (places Ps)) es) (S k)) in N. unfold wide_piece in N. cbv zeta in N. fold es n in N.
    set (C := members P) in *. set (own' := filter _ (comps c)) in N.
    apply andb_prop in N as [N N8]. apply andb_prop in N as [N N7]. apply andb_prop in N as [N N6].
    apply andb_prop in N as [N N5]. apply andb_prop in N as [N N4]. apply andb_prop in N as [N N3]. apply andb_prop in N as [N1 N2].
    assert (Hin : forall i, within (places Ps) k i = mem i C) by (intros i; rewrite (within_mem Ps k i H1 Hk'), EC; reflexivity).
    assert (Eo : own' = own c P).
    { unfold own', own. apply filter_ext. intros D. apply Hin. }
    rewrite Eo in N3, N4, N5.
    assert (Ho : forall e, In e mine <-> In e es /\ In (tgt e) C) by (intros e; unfold mine; rewrite (number_In Ps es k e H1 Hk'), EC; reflexivity).
    assert (Both : forall e, In e es -> (In (src e) C <-> In (tgt e) C)).
    { intros e He. specialize (H2 e He). rewrite <- !mem_In, <- !Hin. unfold within in *.
      destruct (M.find (tgt e) (places Ps)) as [j|]; [|discriminate]. destruct (M.find (src e) (places Ps)) as [j'|]; [|discriminate].
      apply Nat.eqb_eq in H2. subst j'. reflexivity. }
    unfold piece_claim. fold C es. split; [|split; [|split; [|split; [|split; [|split; [|split]]]]]].
    + assert (L : forall j, In j C -> linked es (hd 0 C) j).
      { intros j Hj. rewrite forallb_forall in N2. specialize (N2 j Hj). apply reached_ok in N2 as [s [[<-|[]] L]].
        apply (path_more (mine ++ map swap mine)); [|exact L]. intros e He. apply in_app_iff. apply in_app_iff in He as [He|He].
        - left. apply Ho in He. tauto.
        - right. apply in_map_iff in He as [f [<- Hf]]. apply in_map. apply Ho in Hf. tauto. }
      intros i j Hi. split.
      * intros Hj. apply (path_trans _ i (hd 0 C) j); [apply linked_back; apply L; exact Hi|apply L; exact Hj].
      * intros Hl. unfold linked in Hl. induction Hl as [i|i e He Pa IH]; [exact Hi|]. specialize (IH Hi).
        apply in_app_iff in He as [He|He]; [apply (Both e He); exact IH|].
        apply in_map_iff in He as [f [<- Hf]]. simpl in *. apply (Both f Hf). exact IH.
    + destruct (own c P); [discriminate|discriminate].
    + apply Nat.eqb_eq in N4. rewrite N4. destruct (own c P) as [|D [|]]; try reflexivity. rewrite covers_ok. reflexivity.
    + apply eqb_prop. exact N5.
    + apply (same_truth _ _ _ N6). rewrite forallb_forall. split; intros G e He.
      * intros Ht. specialize (G e (proj2 (Ho e) (Logic.conj He Ht))). apply existsb_exists in G as [f [Hf G]]. apply from_In in Hf as [Hf _].
        apply andb_prop in G as [G1 G2]. apply twin_ok in G1. apply Qeq_bool_eq in G2. exists f. tauto.
      * apply Ho in He as [He Ht]. destruct (G e He Ht) as [f [Hf [G1 [G2 G3]]]]. apply existsb_exists. exists f.
        split; [apply from_In; split; assumption|]. apply andb_true_intro. split; [apply twin_ok; auto|apply Qeq_bool_iff; exact G3].
    + apply (same_truth _ _ _ N7). rewrite forallb_forall. split; intros G e He.
      * intros Ht. apply negative_ok. apply G. apply Ho. split; assumption.
      * apply Ho in He as [He Ht]. apply negative_ok. apply G; assumption.
    + apply (wide_balance_ok es mine); [|exact N8]. intros e He _ Ht. apply Ho. split; assumption.
    + intros x M i HM _ _ _. rewrite E0, Rabs_R0. exact HM.
  - intros i Hi. specialize (H3 i ltac:(apply in_seq; unfold n; lia)). destruct (M.find i (places Ps)) as [k|] eqn:E; [|discriminate].
    apply places_some in E as [Hk Hi']. unfold Ps in Hk, Hi'. rewrite map_length in Hk.
    set (P0 := Piece [] 0 false false false (Cycle [])). change (@nil nat) with (members P0) in Hi'. rewrite map_nth in Hi'.
    exists (nth k (pieces c) P0). split; [apply nth_In; exact Hk|exact Hi'].
  - apply (wide_balance_ok es es); [auto|exact H5].
  - apply (same_truth _ _ _ H6). rewrite forallb_forall. split.
    + intros G e f He Hf E1 E2. specialize (G e He). rewrite forallb_forall in G. specialize (G f (proj2 (from_In es _ f) (Logic.conj Hf E1))).
      assert (T : twin e f = true) by (apply twin_ok; split; assumption). rewrite T in G. apply negative_ok. exact G.
    + intros G e He. apply forallb_forall. intros f Hf. apply from_In in Hf as [Hf E1]. destruct (twin e f) eqn:T; [|reflexivity].
      apply twin_ok in T as [T1 T2]. apply (proj2 (negative_ok (wt e * wt f))). apply G; auto.
Qed.
End Claims.
