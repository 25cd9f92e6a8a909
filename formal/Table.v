(** Finite maps from nodes, for graphs of many nodes: integers by node, members of groups, edges by source, and who is
    reached along edges. Of the maps nothing is used but what is found after something was added. *)
Require Import ZArith QArith List Bool Lia Arith OrderedTypeEx FMapAVL FMapFacts.
Import ListNotations.
Require Import Certificate Graph.
Open Scope nat_scope.

Module M := FMapAVL.Make Nat_as_OT.
Module F := WFacts_fun Nat_as_OT M.

(** * Integers by node, 0 elsewhere *)
Definition get (m : M.t Z) (i : nat) : Z := match M.find i m with Some v => v | None => 0%Z end.
Definition bump (i : nat) (v : Z) (m : M.t Z) : M.t Z := M.add i (get m i + v)%Z m.
Fixpoint table_from (k : nat) (l : list Z) (m : M.t Z) : M.t Z :=
  match l with [] => m | v :: l' => table_from (S k) l' (M.add k v m) end.
Definition table (l : list Z) : M.t Z := table_from 0 l (M.empty Z).

Lemma get_empty i : get (M.empty Z) i = 0%Z.
Proof. unfold get. rewrite F.empty_o. reflexivity. Qed.
Lemma get_add k v m i : get (M.add k v m) i = if k =? i then v else get m i.
Proof.
  unfold get. rewrite F.add_o. destruct (Nat_as_OT.eq_dec k i) as [->|N]; [rewrite Nat.eqb_refl; reflexivity|].
  destruct (Nat.eqb_spec k i); [contradiction|reflexivity].
Qed.
Lemma get_bump i v m j : get (bump i v m) j = if i =? j then (get m j + v)%Z else get m j.
Proof. unfold bump. rewrite get_add. destruct (Nat.eqb_spec i j) as [->|]; reflexivity. Qed.
Lemma get_table_from l : forall k m i, get (table_from k l m) i =
  if (k <=? i) && (i <? k + length l) then nth (i - k) l 0%Z else get m i.
Proof.
  induction l as [|v l IH]; intros k m i; simpl.
  - rewrite Nat.add_0_r. destruct (Nat.leb_spec k i), (Nat.ltb_spec i k); simpl; try lia; reflexivity.
  - rewrite IH, get_add. destruct (Nat.leb_spec (S k) i), (Nat.ltb_spec i (S k + length l)), (Nat.leb_spec k i),
      (Nat.ltb_spec i (k + S (length l))); simpl; try lia; destruct (Nat.eqb_spec k i); try lia; subst; try reflexivity.
    + replace (i - k) with (S (i - S k)) by lia. reflexivity.
    + rewrite Nat.sub_diag. reflexivity.
Qed.
Lemma get_table l i : get (table l) i = nth i l 0%Z.
Proof.
  unfold table. rewrite get_table_from, get_empty, Nat.sub_0_r. simpl.
  destruct (Nat.ltb_spec i (length l)); [reflexivity|]. symmetry. apply nth_overflow. lia.
Qed.

(** * To which of some lists a node belongs: its number *)
Definition place := M.t nat.
Definition put (k : nat) (C : list nat) (m : place) : place := fold_left (fun m i => M.add i k m) C m.
Fixpoint places_from (k : nat) (l : list (list nat)) (m : place) : place :=
  match l with [] => m | C :: l' => places_from (S k) l' (put k C m) end.
Definition within (m : place) (k i : nat) : bool := match M.find i m with Some j => j =? k | None => false end.
(** that no list loses a node to another one *)
Fixpoint apart (k : nat) (l : list (list nat)) (m : place) : bool :=
  match l with [] => true | C :: l' => forallb (within m k) C && apart (S k) l' m end.

Lemma put_find C : forall k m i, M.find i (put k C m) = if mem i C then Some k else M.find i m.
Proof.
  unfold put. induction C as [|j C IH]; intros k m i; simpl; [reflexivity|]. rewrite IH, F.add_o.
  destruct (mem i C) eqn:E; [rewrite orb_true_r; reflexivity|]. rewrite orb_false_r.
  destruct (Nat_as_OT.eq_dec j i) as [->|N]; [rewrite Nat.eqb_refl; reflexivity|].
  destruct (Nat.eqb_spec i j); [congruence|reflexivity].
Qed.
Lemma places_find l : forall k m i j, M.find i (places_from k l m) = Some j ->
  (k <= j < k + length l /\ In i (nth (j - k) l [])) \/ M.find i m = Some j.
Proof.
  induction l as [|C l IH]; intros k m i j H; simpl in H; [right; exact H|].
  destruct (IH _ _ _ _ H) as [[A B]|A].
  - left. simpl. split; [lia|]. destruct (j - k) as [|q] eqn:E; [lia|]. replace (j - S k) with q in B by lia. exact B.
  - rewrite put_find in A. destruct (mem i C) eqn:E; [|right; exact A]. injection A as <-. left. simpl. split; [lia|].
    rewrite Nat.sub_diag. apply mem_In. exact E.
Qed.
Lemma apart_ok l : forall k m, apart k l m = true -> forall j i, j < length l -> In i (nth j l []) -> within m (k + j) i = true.
Proof.
  induction l as [|C l IH]; intros k m H j i Hj Hi; simpl in *; [lia|]. apply andb_prop in H as [H1 H2].
  rewrite forallb_forall in H1. destruct j as [|j].
  - rewrite Nat.add_0_r. apply H1. exact Hi.
  - replace (k + S j) with (S k + j) by lia. apply IH; auto. lia.
Qed.
Definition places (l : list (list nat)) : place := places_from 0 l (M.empty nat).
Lemma within_In l k i : apart 0 l (places l) = true -> k < length l ->
  (within (places l) k i = true <-> In i (nth k l [])).
Proof.
  intros H Hk. split; intros Hi.
  - unfold within in Hi. destruct (M.find i (places l)) as [j|] eqn:E; [|discriminate]. apply Nat.eqb_eq in Hi. subst j.
    unfold places in E. apply places_find in E as [[_ B]|B]; [rewrite Nat.sub_0_r in B; exact B|].
    rewrite F.empty_o in B. discriminate.
  - apply (apart_ok _ _ _ H k i Hk Hi).
Qed.
Lemma within_mem l k i : apart 0 l (places l) = true -> k < length l -> within (places l) k i = mem i (nth k l []).
Proof.
  intros H Hk. apply eq_iff_eq_true. rewrite (within_In l k i H Hk), mem_In. reflexivity.
Qed.
Lemma places_some l i k : M.find i (places l) = Some k -> k < length l /\ In i (nth k l []).
Proof.
  intros E. unfold places in E. apply places_find in E as [[A B]|B]; [rewrite Nat.sub_0_r in B; split; [lia|exact B]|].
  rewrite F.empty_o in B. discriminate.
Qed.

(** * Edges by a number, such as their source *)
Definition ways := M.t (list edge).
Definition from_ (m : ways) (i : nat) : list edge := match M.find i m with Some l => l | None => [] end.
Definition by_key (key : edge -> nat) (es : list edge) : ways :=
  fold_right (fun e m => let k := key e in M.add k (e :: from_ m k) m) (M.empty _) es.
Definition by_source : list edge -> ways := by_key src.
Lemma key_In key es i e : In e (from_ (by_key key es) i) <-> In e es /\ key e = i.
Proof.
  induction es as [|f es IH].
  - unfold from_, by_key. cbn [fold_right]. rewrite F.empty_o. simpl. tauto.
  - change (by_key key (f :: es)) with (M.add (key f) (f :: from_ (by_key key es) (key f)) (by_key key es)).
    unfold from_ at 1. rewrite F.add_o. destruct (Nat_as_OT.eq_dec (key f) i) as [E|N]; cbn [In].
    + rewrite E, IH. split; [intros [<-|[A B]]; auto|intros [[A|A] B]; auto].
    + change (In e (from_ (by_key key es) i) <-> (f = e \/ In e es) /\ key e = i). rewrite IH.
      split; [tauto|]. intros [[<-|A] B]; [contradiction|tauto].
Qed.
Lemma from_In es i e : In e (from_ (by_source es) i) <-> In e es /\ src e = i.
Proof. apply key_In. Qed.
(** edges into each of some lists *)
Definition number (m : place) (e : edge) : nat := match M.find (tgt e) m with Some k => S k | None => 0 end.
Lemma number_In l es k e : apart 0 l (places l) = true -> k < length l ->
  (In e (from_ (by_key (number (places l)) es) (S k)) <-> In e es /\ In (tgt e) (nth k l [])).
Proof.
  intros A Hk. rewrite key_In, <- (within_In l k (tgt e) A Hk). unfold number, within.
  destruct (M.find (tgt e) (places l)) as [j|]; [|split; intros [_ B]; discriminate].
  rewrite Nat.eqb_eq. split; intros [B C]; (split; [exact B|congruence]).
Qed.

(** * Who is reached *)
Definition seen (i : nat) (m : M.t unit) : bool := M.mem i m.
Definition visit (st : list nat * M.t unit) (e : edge) : list nat * M.t unit :=
  if seen (tgt e) (snd st) then st else (tgt e :: fst st, M.add (tgt e) tt (snd st)).
Fixpoint explore (fuel : nat) (m : ways) (st : list nat * M.t unit) : M.t unit :=
  match fuel, fst st with
  | S fuel', i :: q => explore fuel' m (fold_left visit (from_ m i) (q, snd st))
  | _, _ => snd st end.
Definition marked (l : list nat) : M.t unit := fold_left (fun m i => M.add i tt m) l (M.empty unit).
(** at most [n] nodes are ever visited *)
Definition reached (n : nat) (m : ways) (l : list nat) : M.t unit := explore n m (l, marked l).

Lemma seen_add i k m : seen i (M.add k tt m) = (k =? i) || seen i m.
Proof.
  unfold seen. rewrite F.add_b. unfold F.eqb. destruct (Nat_as_OT.eq_dec k i) as [->|N]; [rewrite Nat.eqb_refl; reflexivity|].
  destruct (Nat.eqb_spec k i); [contradiction|reflexivity].
Qed.
Lemma seen_marked l i : seen i (marked l) = true -> In i l.
Proof.
  unfold marked. assert (G : forall m, seen i (fold_left (fun m i => M.add i tt m) l m) = true -> In i l \/ seen i m = true).
  { induction l as [|j l IH]; intros m H; simpl in *; [right; exact H|]. destruct (IH _ H) as [A|A]; [tauto|].
    rewrite seen_add in A. apply orb_prop in A as [A|A]; [apply Nat.eqb_eq in A; tauto|tauto]. }
  intros H. destruct (G _ H) as [A|A]; [exact A|]. unfold seen in A. rewrite F.empty_a in A. discriminate.
Qed.
Lemma visit_ok (P : nat -> Prop) es : (forall e, In e es -> P (tgt e)) -> forall st,
  (forall i, In i (fst st) -> P i) -> (forall i, seen i (snd st) = true -> P i) ->
  (forall i, In i (fst (fold_left visit es st)) -> P i) /\ (forall i, seen i (snd (fold_left visit es st)) = true -> P i).
Proof.
  induction es as [|e es IH]; intros He st H1 H2; simpl; [tauto|]. apply IH.
  - intros f Hf. apply He. right. exact Hf.
  - intros i Hi. unfold visit in Hi. destruct (seen (tgt e) (snd st)); [auto|]. destruct Hi as [<-|Hi]; [apply He; left; reflexivity|auto].
  - intros i Hi. unfold visit in Hi. destruct (seen (tgt e) (snd st)) eqn:E; [auto|]. cbn [snd] in Hi. rewrite seen_add in Hi.
    apply orb_prop in Hi as [Hi|Hi]; [|auto]. apply Nat.eqb_eq in Hi. subst i. apply He. left. reflexivity.
Qed.
Lemma explore_ok es (P : nat -> Prop) : (forall e, In e es -> P (src e) -> P (tgt e)) -> forall fuel st,
  (forall i, In i (fst st) -> P i) -> (forall i, seen i (snd st) = true -> P i) ->
  forall i, seen i (explore fuel (by_source es) st) = true -> P i.
Proof.
  intros HP. induction fuel as [|fuel IH]; intros [q m] H1 H2 i Hi; simpl in Hi; [auto|].
  destruct q as [|j q]; [auto|]. revert Hi. apply IH; apply visit_ok; simpl in *; auto; intros e He;
    apply from_In in He as [He E]; apply HP; auto; subst; auto.
Qed.
Theorem reached_ok n es l i : seen i (reached n (by_source es) l) = true -> exists s, In s l /\ path es s i.
Proof.
  unfold reached. apply (explore_ok es (fun i => exists s, In s l /\ path es s i)).
  - intros e He [s [Hs P]]. exists s. split; [exact Hs|]. apply path_step; assumption.
  - intros j Hj. exists j. split; [exact Hj|constructor].
  - intros j Hj. exists j. split; [apply seen_marked; exact Hj|constructor].
Qed.
Lemma path_more es es' i j : (forall e, In e es -> In e es') -> path es i j -> path es' i j.
Proof. intros H P. induction P as [i|i e He P IH]; [constructor|]. apply path_step; auto. Qed.
