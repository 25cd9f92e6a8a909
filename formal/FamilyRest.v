(** The states at rest of a family: as many as every mandatory graph has. Some of them has given signs on any set of agents
    that is closed in a mandatory graph whose edges agree with the signs, and is at most 1 elsewhere. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Claims Mean Table Dominance Rest Wide FamilyCertificate FamilyChecker
  FamilySound FamilyMotion FamilyRows.
Open Scope R_scope.

Lemma no_size x : Rabs x <= 0 -> x = 0.
Proof. intros H. pose proof (Rabs_pos x). destruct (Req_dec x 0) as [Z|Z]; [exact Z|]. apply Rabs_pos_lt in Z. lra. Qed.
(** * Fewer equations than unknowns *)
(** unknowns are numbers at the first entries of the list *)
Definition tot (bs : list (nat * list Q)) (l : nat * list Q -> R) (c : nat -> R) : R := fold_right (fun b a => l b * c (fst b) + a) 0 bs.
Lemma tot_ext bs l l' c c' : (forall b, In b bs -> l b = l' b /\ c (fst b) = c' (fst b)) -> tot bs l c = tot bs l' c'.
Proof.
  induction bs as [|b bs IH]; intros H; simpl; [reflexivity|]. rewrite IH by (intros; apply H; right; assumption).
  destruct (H b ltac:(left; reflexivity)) as [-> ->]. reflexivity.
Qed.
Lemma tot_minus bs l l' a c : tot bs (fun b => l b - a * l' b) c = tot bs l c - a * tot bs l' c.
Proof. induction bs as [|b bs IH]; simpl; [ring|]. rewrite IH. ring. Qed.
Lemma tot_scal bs l a c : tot bs l (fun i => a * c i) = a * tot bs l c.
Proof. induction bs as [|b bs IH]; simpl; [ring|]. rewrite IH. ring. Qed.
Lemma tot_plus bs l c c' : tot bs l (fun i => c i + c' i) = tot bs l c + tot bs l c'.
Proof. induction bs as [|b bs IH]; simpl; [ring|]. rewrite IH. ring. Qed.
Lemma tot_zero bs l c : (forall b, In b bs -> c (fst b) = 0) -> tot bs l c = 0.
Proof.
  intros H. rewrite (tot_ext bs l l c (fun _ => 0 * 0)) by (intros b Hb; rewrite (H b Hb); split; ring). rewrite (tot_scal bs l 0 (fun _ => 0)). ring.
Qed.
Lemma tot_null bs l c : (forall b, In b bs -> l b = 0) -> tot bs l c = 0.
Proof.
  induction bs as [|b bs IH]; intros H; simpl; [reflexivity|]. rewrite IH by (intros; apply H; right; assumption).
  rewrite (H b) by (left; reflexivity). ring.
Qed.
Lemma tot_single bs l c b : NoDup (map fst bs) -> In b bs -> (forall b', In b' bs -> fst b' <> fst b -> l b' = 0) ->
  tot bs l c = l b * c (fst b).
Proof.
  induction bs as [|b0 bs IH]; intros N Hb H; [destruct Hb|]. simpl in N. apply NoDup_cons_iff in N as [N1 N2]. simpl.
  destruct Hb as [->|Hb].
  - rewrite tot_null; [ring|]. intros b' Hb'. apply H; [right; exact Hb'|]. intros E. apply N1. rewrite <- E. apply in_map. exact Hb'.
  - rewrite (IH N2 Hb) by (intros; apply H; [right|]; assumption).
    rewrite (H b0); [ring|left; reflexivity|]. intros E. apply N1. rewrite E. apply in_map. exact Hb.
Qed.
Lemma distinct_ok l : distinct l = true -> NoDup l.
Proof.
  induction l as [|i l IH]; intros H; constructor; simpl in H; apply andb_prop in H as [A B]; [|apply IH; exact B].
  intros I. apply mem_In in I. rewrite I in A. discriminate.
Qed.
Lemma fewer bs : NoDup (map fst bs) -> forall Ls, (length Ls < length bs)%nat ->
  exists c, (exists b, In b bs /\ c (fst b) <> 0) /\ forall l, In l Ls -> tot bs l c = 0.
Proof.
  induction bs as [|b bs IH]; intros N Ls HL; [simpl in HL; lia|]. simpl in N. apply NoDup_cons_iff in N as [N1 N2].
  assert (K : forall c v, tot bs c (fun i => if (i =? fst b)%nat then v else 0) = 0).
  { intros c v. apply tot_zero. intros b' Hb'. destruct (Nat.eqb_spec (fst b') (fst b)) as [E|_]; [|reflexivity].
    exfalso. apply N1. rewrite <- E. apply in_map. exact Hb'. }
  destruct (Classical_Prop.classic (exists l, In l Ls /\ l b <> 0)) as [[l0 [H0 Z0]]|No].
  - destruct (in_split _ _ H0) as [L1 [L2 ->]].
    destruct (IH N2 (map (fun l b' => l b' - l b / l0 b * l0 b') (L1 ++ L2))) as [c [[b1 [B1 B2]] Hc]].
    { rewrite map_length. rewrite app_length in *. simpl in HL. lia. }
    set (c' := fun i => if (i =? fst b)%nat then - tot bs l0 c / l0 b else c i).
    assert (E : forall l, tot bs l c' = tot bs l c).
    { intros l. apply tot_ext. intros b' Hb'. split; [reflexivity|]. unfold c'. destruct (Nat.eqb_spec (fst b') (fst b)) as [E|_]; [|reflexivity].
      exfalso. apply N1. rewrite <- E. apply in_map. exact Hb'. }
    exists c'. split.
    + exists b1. split; [right; exact B1|]. unfold c'. destruct (Nat.eqb_spec (fst b1) (fst b)) as [E1|_]; [|exact B2].
      exfalso. apply N1. rewrite <- E1. apply in_map. exact B1.
    + intros l Hl. simpl. rewrite E. unfold c'. rewrite Nat.eqb_refl. apply in_app_iff in Hl.
      assert (Hl' : l = l0 \/ In l (L1 ++ L2)) by (rewrite in_app_iff; destruct Hl as [Hl|[Hl|Hl]]; auto).
      destruct Hl' as [->|Hl']; [field; exact Z0|].
      specialize (Hc _ (in_map (fun l b' => l b' - l b / l0 b * l0 b') _ _ Hl')). cbv beta in Hc. rewrite tot_minus in Hc.
      replace (tot bs l c) with (l b / l0 b * tot bs l0 c) by lra. field. exact Z0.
  - exists (fun i => if (i =? fst b)%nat then 1 else 0). split.
    + exists b. split; [left; reflexivity|]. rewrite Nat.eqb_refl. lra.
    + intros l Hl. simpl. rewrite K, Nat.eqb_refl. destruct (Req_dec (l b) 0) as [->|E]; [ring|]. exfalso. apply No. exists l. auto.
Qed.
(** as many equations as unknowns have a solution, if without right sides they have but one *)
Lemma solvable bs (l : nat -> nat * list Q -> R) J : NoDup (map fst bs) -> (length J <= length bs)%nat ->
  (forall c, (forall j, In j J -> tot bs (l j) c = 0) -> forall b, In b bs -> c (fst b) = 0) ->
  forall tau, exists c, forall j, In j J -> tot bs (l j) c = tau j.
Proof.
  intros N HL H tau. set (new := S (list_max (map fst bs))).
  assert (New : forall b, In b bs -> fst b <> new).
  { intros b Hb E. assert (M : List.Forall (fun i => (i <= list_max (map fst bs))%nat) (map fst bs)) by (apply list_max_le; lia).
    rewrite Forall_forall in M. specialize (M (fst b) (in_map fst _ _ Hb)). unfold new in E. lia. }
  set (l' := fun j b => if (fst b =? new)%nat then - tau j else l j b).
  destruct (fewer ((new, []) :: bs)) with (Ls := map l' J) as [c [[b [B1 B2]] Hc]].
  { simpl. constructor; [|exact N]. intros I. apply in_map_iff in I as [b [E Hb]]. exact (New b Hb E). }
  { rewrite map_length. simpl. lia. }
  assert (E : forall j, In j J -> tot bs (l j) c = tau j * c new).
  { intros j Hj. specialize (Hc _ (in_map l' _ _ Hj)). simpl in Hc. unfold l' at 1 in Hc. simpl in Hc. rewrite Nat.eqb_refl in Hc.
    rewrite (tot_ext bs (l' j) (l j) c c) in Hc; [lra|]. intros b' Hb'. split; [|reflexivity]. unfold l'.
    destruct (Nat.eqb_spec (fst b') new) as [E|_]; [destruct (New b' Hb' E)|reflexivity]. }
  destruct (Req_dec (c new) 0) as [Z|Z].
  - exfalso. assert (A : forall b, In b bs -> c (fst b) = 0) by (apply H; intros j Hj; rewrite (E j Hj), Z; ring).
    destruct B1 as [<-|B1]; [exact (B2 Z)|exact (B2 (A b B1))].
  - exists (fun i => / c new * c i). intros j Hj. rewrite tot_scal, (E j Hj). field. exact Z.
Qed.

(** * Smallest members *)
Lemma smallest_ok n l : forallb (check_tie n) l = true -> exists w, admits l w /\ forall x i, member l w x i = lap (smallest l) x i.
Proof.
  induction l as [|e l IH]; intros H.
  - exists (fun _ => 0). split; [intros [|j] e E; discriminate E|reflexivity].
  - simpl in H. apply andb_prop in H as [H1 H2]. destruct (IH H2) as [w [W1 W2]].
    assert (HB : Q2R (bottom e) <= Q2R (top e)).
    { unfold check_tie in H1. apply andb_prop in H1 as [_ H1]. apply Qle_R in H1. unfold lo, hi in H1. destruct (positive e); [exact H1|].
      rewrite !Q2R_opp in H1. lra. }
    set (v := if Qlt_le_dec 0 (bottom e) then Q2R (bottom e) else if Qlt_le_dec (top e) 0 then Q2R (top e) else 0).
    exists (fun j => match j with O => v | S j' => w j' end). split.
    + intros [|j] e' E; [|exact (W1 j e' E)]. injection E as <-. unfold v.
      destruct (Qlt_le_dec 0 (bottom e)) as [A|A]; [lra|]. apply Qle_Rle in A. rewrite Q2R_0 in A.
      destruct (Qlt_le_dec (top e) 0) as [B|B]; [lra|]. apply Qle_Rle in B. rewrite Q2R_0 in B. lra.
    + intros x i. cbn [member]. change (shift (fun j => match j with O => v | S j' => w j' end)) with w. rewrite W2.
      unfold smallest. cbn [flat_map]. fold (smallest l).
      assert (A : forall es fs, lap (es ++ fs) x i = lap es x i + lap fs x i).
      { intros es fs. unfold lap. induction es as [|f es IHe]; simpl; [ring|]. rewrite IHe. ring. }
      assert (T : forall q, lap (there e q) x i = pulls e (Q2R q) x i).
      { intros q. unfold there, pulls, lap, heard, lap_edge. destruct (mutual e); simpl.
        - destruct (Nat.eqb_spec (head e) i) as [->|_], (Nat.eqb_spec (tail e) i) as [->|_]; ring.
        - destruct (Nat.eqb_spec (head e) i) as [->|_]; ring. }
      rewrite A. f_equal. unfold v.
      destruct (Qlt_le_dec 0 (bottom e)); [symmetry; apply T|]. destruct (Qlt_le_dec (top e) 0); [symmetry; apply T|].
      unfold pulls, heard. rewrite Rabs_R0. destruct (head e =? i)%nat, (mutual e), (tail e =? i)%nat; simpl; ring.
Qed.
Lemma smallest_edges n l e : forallb (check_tie n) l = true -> In e (smallest l) ->
  (tgt e < n)%nat /\ (src e < n)%nat /\ Q2R (wt e) <> 0 /\ exists t, In t l /\ In (Edge (tgt e) (src e) 1%Q) (there t 1%Q).
Proof.
  intros H He. unfold smallest in He. apply in_flat_map in He as [t [Ht He]]. rewrite forallb_forall in H. specialize (H t Ht).
  unfold check_tie in H. apply andb_prop in H as [H _]. apply andb_prop in H as [H _]. apply andb_prop in H as [A B]. apply Nat.ltb_lt in A, B.
  assert (K : forall q, Q2R q <> 0 -> In e (there t q) -> (tgt e < n)%nat /\ (src e < n)%nat /\ Q2R (wt e) <> 0 /\
    exists t, In t l /\ In (Edge (tgt e) (src e) 1%Q) (there t 1%Q)).
  { intros q Hq Hi. unfold there in Hi. destruct Hi as [<-|Hi]; simpl.
    - repeat split; auto. exists t. split; [exact Ht|left; reflexivity].
    - destruct (mutual t) eqn:M; [|destruct Hi]. destruct Hi as [<-|[]]. simpl. repeat split; auto. exists t. split; [exact Ht|].
      unfold there. rewrite M. right. left. reflexivity. }
  destruct (Qlt_le_dec 0 (bottom t)) as [Q|_]; [|destruct (Qlt_le_dec (top t) 0) as [Q|_]; [|destruct He]].
  - apply (K (bottom t)); [|exact He]. apply Qlt_Rlt in Q. rewrite Q2R_0 in Q. lra.
  - apply (K (top t)); [|exact He]. apply Qlt_Rlt in Q. rewrite Q2R_0 in Q. lra.
Qed.

(** * The kernel *)
Definition comb (P : part) (z : nat -> R) (i : nat) : R := tot (still P) (fun b => Q2R (nth i (snd b) 0%Q)) z.
Lemma xi_comb P x i : xi P x i = x i - comb P x i.
Proof. reflexivity. Qed.
Definition sg (b : bool) : R := if b then 1 else -1.
(** the sign of the source with which an edge agrees *)
Definition turn (e : edge) (b : bool) : bool := if Rlt_dec 0 (Q2R (wt e)) then b else negb b.
Lemma turn_ok e b : Q2R (wt e) * sg (turn e b) = Rabs (Q2R (wt e)) * sg b.
Proof.
  unfold turn. destruct (Rlt_dec 0 (Q2R (wt e))) as [L|L].
  - rewrite Rabs_right by lra. reflexivity.
  - rewrite Rabs_left1 by lra. destruct b; simpl; ring.
Qed.

Lemma node_dec (a b : nat * bool) : {a = b} + {a <> b}.
Proof. decide equality; [apply Bool.bool_dec|apply Nat.eq_dec]. Qed.

Section Kernel.
Variables (F : family) (P : part).
Let n := order (frame F).
Let C := its_agents P.
Hypothesis Hmodes : forallb (check_mode F) (modes F) = true.
Hypothesis Hpart : check_part F P = true.
Hypothesis Hbasis : check_pivots F P = true.
Hypothesis Hdepends : becomes P <> Depends.

Lemma agents_in i : In i C -> (i < n)%nat.
Proof.
  unfold check_pivots in Hbasis. cbv zeta in Hbasis. apply andb_prop in Hbasis as [H _]. rewrite forallb_forall in H.
  intros Hi. apply Nat.ltb_lt. apply H. exact Hi.
Qed.
Lemma basis_parts : NoDup (map fst (still P)) /\ (forall b, In b (still P) -> In (fst b) C) /\
  forall b b', In b (still P) -> In b' (still P) -> Q2R (nth (fst b') (snd b) 0%Q) = if (fst b =? fst b')%nat then 1 else 0.
Proof.
  unfold check_pivots in Hbasis. cbv zeta in Hbasis. fold C in Hbasis. apply andb_prop in Hbasis as [_ B].
  assert (H : distinct (map fst (still P)) && forallb (fun b => mem (fst b) C && forallb (fun b' =>
    Qeq_bool (nth (fst b') (snd b) 0%Q) (if (fst b =? fst b')%nat then 1%Q else 0%Q)) (still P)) (still P) = true)
    by (destruct (becomes P); try exact B; contradiction Hdepends; reflexivity).
  apply andb_prop in H as [H2 H3]. rewrite forallb_forall in H3. split; [apply distinct_ok; exact H2|]. split; intros b.
  - intros Hb. specialize (H3 b Hb). apply andb_prop in H3 as [A _]. apply mem_In. exact A.
  - intros b' Hb Hb'. specialize (H3 b Hb). apply andb_prop in H3 as [_ A]. rewrite forallb_forall in A. specialize (A b' Hb').
    apply Qeq_R in A. rewrite A. destruct (fst b =? fst b')%nat; unfold Q2R; simpl; lra.
Qed.
Lemma comb_pivot z b : In b (still P) -> comb P z (fst b) = z (fst b).
Proof.
  intros Hb. destruct basis_parts as [N [_ I]]. unfold comb. rewrite (tot_single _ _ _ b N Hb).
  - rewrite (I b b Hb Hb), Nat.eqb_refl. ring.
  - intros b' Hb' Ne. rewrite (I b' b Hb' Hb). destruct (Nat.eqb_spec (fst b') (fst b)); [contradiction|reflexivity].
Qed.
Lemma comb_comb z i : comb P (comb P z) i = comb P z i.
Proof. unfold comb at 1 3. apply tot_ext. intros b Hb. split; [reflexivity|apply comb_pivot; exact Hb]. Qed.
Lemma part_inside m e : In m (modes F) -> In e (edges (mandatory m)) ->
  (tgt e < n)%nat /\ (src e < n)%nat /\ Q2R (wt e) <> 0 /\ (In (src e) C <-> In (tgt e) C).
Proof.
  intros Hm He. destruct (modes_claim F Hmodes m Hm) as [Ee _]. rewrite Ee in He.
  destruct (smallest_edges n (ties m) e (ties_ok F Hmodes m Hm) He) as [A [B [D [t [Ht It]]]]]. split; [exact A|]. split; [exact B|]. split; [exact D|].
  unfold check_part in Hpart. cbv zeta in Hpart. apply andb_prop in Hpart as [H _]. apply andb_prop in H as [H _]. apply andb_prop in H as [_ H].
  rewrite forallb_forall in H. specialize (H (Edge (tgt e) (src e) 1%Q)). simpl in H. fold C in H.
  rewrite <- !mem_In. rewrite (eqb_prop _ _ (H ltac:(unfold every_edge; apply in_flat_map; exists t; split; [apply in_flat_map; exists m; auto|exact It]))). reflexivity.
Qed.
Lemma part_ties m e : In m (modes F) -> In e (ties m) -> In (head e) C <-> In (tail e) C.
Proof.
  intros Hm He. unfold check_part in Hpart. cbv zeta in Hpart. apply andb_prop in Hpart as [H _]. apply andb_prop in H as [H _].
  apply andb_prop in H as [_ H]. rewrite forallb_forall in H. specialize (H (Edge (head e) (tail e) 1%Q)). simpl in H. fold C in H.
  rewrite <- !mem_In. rewrite (eqb_prop _ _ (H ltac:(unfold every_edge; apply in_flat_map; exists e; split; [apply in_flat_map; exists m; auto|left; reflexivity]))). reflexivity.
Qed.
Lemma basis_rest m w b i : In m (modes F) -> admits (ties m) w -> In b (still P) -> member (ties m) w (fun j => Q2R (nth j (snd b) 0%Q)) i = 0.
Proof.
  intros Hm Hw Hb. unfold check_part in Hpart. cbv zeta in Hpart. apply andb_prop in Hpart as [H _]. apply andb_prop in H as [_ H].
  destruct (becomes P); try (contradiction Hdepends; reflexivity); rewrite forallb_forall in H; specialize (H m Hm); apply andb_prop in H as [_ R];
    rewrite forallb_forall in R; apply (rest_ok F Hmodes (common_of (still P)) m (snd b) Hm (R _ Hb) w i Hw).
Qed.
Lemma basis_size m : In m (modes F) -> length (filter is_balanced (owned m P)) = length (still P).
Proof.
  intros Hm. unfold check_part in Hpart. cbv zeta in Hpart. apply andb_prop in Hpart as [H _]. apply andb_prop in H as [_ H].
  destruct (becomes P); try (contradiction Hdepends; reflexivity); rewrite forallb_forall in H; specialize (H m Hm); apply andb_prop in H as [L _];
    apply Nat.eqb_eq; exact L.
Qed.
Lemma comb_rest m w z i : In m (modes F) -> admits (ties m) w -> member (ties m) w (comb P z) i = 0.
Proof.
  intros Hm Hw. rewrite (member_xi (ties m) w P i (fun b Hb => basis_rest m w b i Hm Hw Hb)).
  rewrite (member_same _ _ _ (fun _ => 0 * 0)) by (intros j; rewrite xi_comb, comb_comb; ring). rewrite (member_scal _ _ 0 (fun _ => 0)). ring.
Qed.

Section Mandatory.
Variable m : mode.
Hypothesis Hm : In m (modes F).
Let c := mandatory m.
Let es := edges c.
Lemma mode_parts : order c = n /\ wide_structure c = true.
Proof.
  destruct (modes_claim F Hmodes m Hm) as [_ [E _]]. split; [exact E|]. rewrite forallb_forall in Hmodes. specialize (Hmodes m Hm).
  unfold check_mode in Hmodes. cbv zeta in Hmodes. apply andb_prop in Hmodes as [H _]. apply andb_prop in H as [_ H]. exact H.
Qed.
Lemma Hr e : In e es -> (tgt e < n)%nat /\ (src e < n)%nat.
Proof. intros He. destruct (part_inside m e Hm He) as [A [B _]]. auto. Qed.
Lemma Hnz e : In e es -> Q2R (wt e) <> 0.
Proof. intros He. destruct (part_inside m e Hm He) as [_ [_ [D _]]]. exact D. Qed.
Lemma comb_lap z i : lap es (comb P z) i = 0.
Proof.
  destruct (smallest_ok n (ties m) (ties_ok F Hmodes m Hm)) as [w [W1 W2]]. destruct (modes_claim F Hmodes m Hm) as [Ee _].
  unfold es, c. rewrite Ee, <- W2. apply comb_rest; assumption.
Qed.
Lemma hd_in (D : comp) : In D (comps c) -> In (hd O (nodes D)) (nodes D) /\ (hd O (nodes D) < n)%nat.
Proof.
  intros HD. destruct mode_parts as [En W]. destruct (wide_parts c W) as [_ [W1 [W2 _]]]. rewrite En in W1. destruct (W2 D HD) as [[[i Hi] _] _].
  assert (A : In (hd O (nodes D)) (nodes D)) by (destruct (nodes D); [destruct Hi|left; reflexivity]). split; [exact A|apply (W1 D _ HD A)].
Qed.
(** what is at rest is largest at the head of a balanced closed component *)
Lemma kernel_bound y M : 0 <= M -> (forall i, (i < n)%nat -> lap es y i = 0) ->
  (forall D, In D (owned m P) -> is_balanced D = true -> Rabs (y (hd O (nodes D))) <= M) -> forall i, In i C -> Rabs (y i) <= M.
Proof.
  intros HM Hy HB i Hi. destruct mode_parts as [En W]. destruct (wide_parts c W) as [_ [W1 [_ W3]]]. rewrite En in W1, W3.
  destruct (largest_of (fun i => Rabs (y i)) C) as [b [Hb MB]]; [intros E; rewrite E in Hi; destruct Hi|].
  specialize (MB i Hi) as Li. eapply Rle_trans; [exact Li|]. destruct (W3 b (agents_in b Hb)) as [D [HD [_ HP]]].
  assert (Cl : forall e, In e es -> In (tgt e) C -> In (src e) C) by (intros e He Ht; apply (part_inside m e Hm He); exact Ht).
  rewrite <- (path_same n es y Hr Hnz (fun j => In j C) (Rabs (y b)) (fun j Hj _ => Hy j Hj) Cl MB _ b HP Hb eq_refl).
  assert (Ho : In D (owned m P)).
  { unfold owned. apply filter_In. split; [exact HD|]. apply mem_In. apply (closed_path es (fun j => In j C) _ b Cl HP Hb). }
  destruct (is_balanced D) eqn:E; [apply HB; assumption|]. unfold is_balanced in E. destruct (camps D) as [|cy] eqn:E'; [discriminate|].
  destruct (hd_in D HD) as [Hh Hn]. pose proof (wide_structure_ok c W) as Hs.
  assert (Z : y (hd O (nodes D)) = 0).
  { apply (comp_zero c) with (C := D) (cy := cy); auto; fold es; rewrite ?En; auto; [exact Hr|exact Hnz]. }
  rewrite Z, Rabs_R0. exact HM.
Qed.
Lemma heads_solve tau : exists z, forall D, In D (owned m P) -> is_balanced D = true -> comb P z (hd O (nodes D)) = tau (hd O (nodes D)).
Proof.
  destruct basis_parts as [N [HP _]].
  destruct (solvable (still P) (fun j b => Q2R (nth j (snd b) 0%Q)) (map (fun D => hd O (nodes D)) (filter is_balanced (owned m P))) N) with (tau := tau) as [z Hz].
  - rewrite map_length, (basis_size m Hm). lia.
  - intros z Hz b Hb. rewrite <- (comb_pivot z b Hb).
    assert (A : Rabs (comb P z (fst b)) <= 0).
    { apply (kernel_bound (comb P z) 0 (Rle_refl 0)); [intros; apply comb_lap| |apply HP; exact Hb]. intros D HD HB.
      assert (Z : comb P z (hd O (nodes D)) = 0).
      { apply Hz. apply in_map_iff. exists D. split; [reflexivity|]. apply filter_In. auto. }
      rewrite Z, Rabs_R0. apply Rle_refl. }
    apply no_size. exact A.
  - exists z. intros D HD HB. apply Hz. apply in_map_iff. exists D. split; [reflexivity|]. apply filter_In. auto.
Qed.
Variable A : list (nat * bool).
Hypothesis HA : forall k b, In (k, b) A -> In k C /\ ~ In (k, negb b) A.
Hypothesis Hclosed : forall k b e, In (k, b) A -> In e es -> tgt e = k -> In (src e, turn e b) A.
Let tau k := if in_dec node_dec (k, true) A then 1 else if in_dec node_dec (k, false) A then -1 else 0.
Theorem extends : exists z, (forall i, In i C -> Rabs (comb P z i) <= 1) /\ forall k b, In (k, b) A -> comb P z k = sg b.
Proof.
  assert (T : forall k b, In (k, b) A -> tau k = sg b).
  { intros k b Hk. destruct (HA k b Hk) as [_ No]. unfold tau. destruct b; simpl in No.
    - destruct (in_dec node_dec (k, true) A); [reflexivity|contradiction].
    - destruct (in_dec node_dec (k, true) A); [contradiction|]. destruct (in_dec node_dec (k, false) A); [reflexivity|contradiction]. }
  assert (T1 : forall k, Rabs (tau k) <= 1).
  { intros k. unfold tau. destruct (in_dec node_dec (k, true) A); [rewrite Rabs_R1; lra|].
    destruct (in_dec node_dec (k, false) A); [rewrite Rabs_left; lra|rewrite Rabs_R0; lra]. }
  destruct (heads_solve tau) as [z Hz]. exists z. split.
  { apply (kernel_bound (comb P z) 1 ltac:(lra)); [intros; apply comb_lap|]. intros D HD HB. rewrite (Hz D HD HB). apply T1. }
  set (S := fun k => exists b, In (k, b) A). set (y := fun i => comb P z i - tau i).
  assert (Cl : forall e, In e es -> S (tgt e) -> S (src e)) by (intros e He [b Hb]; exists (turn e b); apply (Hclosed (tgt e)); auto).
  assert (Hy : forall i, (i < n)%nat -> S i -> lap es y i = 0).
  { intros i _ [b Hb]. unfold y. rewrite lap_minus, comb_lap. rewrite lap_esum.
    rewrite (esum_ext _ _ (fun e => 0 * lap_edge i tau e)); [rewrite esum_scal; ring|]. intros e He. rewrite Rmult_0_l. unfold lap_edge.
    destruct (Nat.eqb_spec (tgt e) i) as [E|_]; [|reflexivity]. rewrite (T i b Hb), (T _ _ (Hclosed i b e Hb He E)), turn_ok. ring. }
  destruct mode_parts as [En W]. destruct (wide_parts c W) as [_ [_ [W2 W3]]]. rewrite En in W3.
  assert (Z : forall k, S k -> y k = 0).
  { intros k Hk. destruct (largest_of (fun i => Rabs (y i)) (map fst A)) as [a [Ha MA]].
    { destruct Hk as [b Hb]. intros E. apply (in_map fst) in Hb. rewrite E in Hb. destruct Hb. }
    assert (HS : forall i, S i <-> In i (map fst A)).
    { intros i. split; [intros [b Hb]; apply (in_map fst _ _ Hb)|]. intros I. apply in_map_iff in I as [[i' b] [<- I]]. exists b. exact I. }
    assert (Sa : S a) by (apply HS; exact Ha).
    assert (Ba : forall i, S i -> Rabs (y i) <= Rabs (y a)) by (intros i Hi; apply MA; apply HS; exact Hi).
    assert (Sn : forall i, S i -> In i C) by (intros i [b Hb]; apply (HA i b Hb)).
    destruct (W3 a (agents_in a (Sn a Sa))) as [D [HD [_ HP]]]. destruct (hd_in D HD) as [Hh _]. set (h := hd O (nodes D)) in *.
    assert (Sh : S h) by (apply (closed_path es S h a Cl HP Sa)).
    assert (Eh : Rabs (y h) = Rabs (y a)) by (apply (path_same n es y Hr Hnz S (Rabs (y a)) Hy Cl Ba h a HP Sa eq_refl)).
    assert (Ho : In D (owned m P)) by (unfold owned; apply filter_In; split; [exact HD|apply mem_In; apply Sn; exact Sh]).
    assert (Y0 : y h = 0).
    { destruct (is_balanced D) eqn:E; [pose proof (Hz D Ho E) as Q; fold h in Q; unfold y; lra|]. exfalso.
      unfold is_balanced in E. destruct (W2 D HD) as [[_ [_ St]] B]. destruct (camps D) as [|cy]; [discriminate|].
      apply (B (fun i => if in_dec node_dec (i, true) A then 1%Z else (-1)%Z)). split.
      - intros i _. destruct (in_dec node_dec (i, true) A); auto.
      - intros e He Hse Hte. destruct (closed_path es S _ _ Cl (St _ _ Hte Hh) Sh) as [b Hb]. pose proof (Hclosed _ b e Hb He eq_refl) as Hs.
        assert (G : forall k b, In (k, b) A -> (if in_dec node_dec (k, true) A then 1%Z else (-1)%Z) = if b then 1%Z else (-1)%Z).
        { intros i b' Hi. pose proof (T i b' Hi) as Ti. unfold tau in Ti. destruct (in_dec node_dec (i, true) A).
          - destruct b'; [reflexivity|simpl in Ti; lra].
          - destruct b'; [contradiction|reflexivity]. }
        rewrite (G _ _ Hb), (G _ _ Hs). apply Rlt_Qlt. rewrite Q2R_mult, Q2R_0. pose proof (Hnz e He) as Z. unfold turn.
        set (w := Q2R (wt e)) in *. destruct (Rlt_dec 0 w), b; unfold Q2R, inject_Z; simpl; lra. }
    pose proof (Ba k Hk) as L. rewrite <- Eh, Y0, Rabs_R0 in L. apply no_size. exact L. }
  intros k b Hk. rewrite <- (T k b Hk). specialize (Z k (ex_intro _ b Hk)). unfold y in Z. lra.
Qed.
End Mandatory.
End Kernel.
