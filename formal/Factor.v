(** What a sparse factor proves of a leader group. Of a group that is not balanced every [z] is taken; of a balanced one
    [z = L c], [c] 0 at one node, or, if the weights [eta] have [eta'L = 0], [z = B c], one column
    [eta_q e_i - eta_i e_q] of [B] for each edge [(i, q)] of a tree, whose root is no [i]. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Mean Table Dominance Group Sparse.
Open Scope R_scope.

(** * The check *)
(** edges of a tree go from a node to one nearer to the root, and stand before those of the latter *)
Inductive basis := Whole | Pinned (root : nat) (g : list (nat * Z)) | Tree (root : nat) (eta : list (nat * Z)) (hops : list (nat * nat)).
(** nodes as they are eliminated, each with its scale; [by_times] the form is [by_squares R R' + E] *)
Record sparse := Sparse { how : basis; eliminated : list (nat * Z); by_times : Z; by_squares : Z; columns_of : list row; spread : list Z }.
(** a leader group by number, its rate for weights in these ratios, and its factor *)
Record fact := Fact { whose : nat; decays : Q; ratios : list (nat * Z); factor_is : sparse }.
Definition by_node (l : list (nat * Z)) : M.t Z := fold_right (fun e m => M.add (fst e) (snd e) m) (M.empty Z) l.
Fixpoint ranks (k : nat) (l : list (nat * Z)) (m : M.t (nat * Z)) : M.t (nat * Z) :=
  match l with [] => m | (i, s) :: l' => ranks (S k) l' (M.add i (k, s) m) end.
Definition term (m : M.t (nat * Z)) (i : nat) : row := match M.find i m with Some e => [e] | None => [] end.
Definition placed (m : M.t (nat * Z)) (i : nat) : bool := match M.find i m with Some _ => true | None => false end.
Definition pinned_rows (ls : Z) (own : list edge) (m : M.t (nat * Z)) : rows :=
  fold_right (fun e b => let w := scaled ls (wt e) in
    add_at (tgt e) (Z.abs w) (term m (tgt e)) (add_at (tgt e) (- w) (term m (src e)) b)) none own.
Definition tree_rows (eta : M.t Z) (hops : list (nat * nat)) (m : M.t (nat * Z)) : rows :=
  fold_right (fun h b => add_at (fst h) (get eta (snd h)) (term m (fst h)) (add_at (snd h) (- get eta (fst h)) (term m (fst h)) b)) none hops.
Definition basis_rows (ls : Z) (own : list edge) (b : basis) (m : M.t (nat * Z)) : nat -> row :=
  match b with Whole => term m | Pinned _ _ => at_ (pinned_rows ls own m) | Tree _ eta hops => at_ (tree_rows (by_node eta) hops m) end.
(** [eta'L], by node *)
Definition left_product (ls : Z) (own : list edge) (eta : M.t Z) : M.t Z :=
  fold_right (fun e m => let w := scaled ls (wt e) in
    bump (tgt e) (get eta (tgt e) * Z.abs w)%Z (bump (src e) (- (get eta (tgt e) * w))%Z m)) (M.empty Z) own.
Definition hop (h : nat * nat) (st : option (M.t Datatypes.unit)) : option (M.t Datatypes.unit) :=
  match st with Some m => if seen (snd h) m && negb (seen (fst h) m) then Some (M.add (fst h) tt m) else None | None => None end.
Definition check_basis (ls : Z) (own : list edge) (C : list nat) (b : basis) (m : M.t (nat * Z)) : bool :=
  match b with
  | Whole => forallb (placed m) C
  | Pinned root l => let g := by_node l in (get g root * get g root =? 1)%Z && forallb (fun i => placed m i || (i =? root)%nat) C &&
      forallb (fun e => let w := scaled ls (wt e) in Z.abs w * get g (tgt e) =? w * get g (src e))%Z own
  | Tree root l hops => let eta := by_node l in let z := left_product ls own eta in
      forallb (fun i => (get z i =? 0) && negb (get eta i =? 0))%Z C && forallb (fun h => placed m (fst h) && negb (get eta (fst h) =? 0)%Z && negb (get eta (snd h) =? 0)%Z) hops &&
      match fold_right hop (Some (M.add root tt (M.empty Datatypes.unit))) hops with Some s => forallb (fun i => seen i s) C | None => false end end.
Definition pull_rows (ls gd : Z) (r : M.t Z) (own : list edge) (b : nat -> row) : rows :=
  fold_right (fun e m => let w := scaled ls (wt e) in let a := (2 * gd * get r (tgt e))%Z in
    add_at (tgt e) (a * Z.abs w) (b (tgt e)) (add_at (tgt e) (- (a * w)) (b (src e)) m)) none own.
Definition spread_row (times : Z) (u b : row) (T : rows) : rows := fold_right (fun e m => add_at (fst e) (times * snd e) u m) T b.
Definition check_factor (own : list edge) (C : list nat) (F : fact) : bool :=
  let ls := common (map wt own) in let r := by_node (ratios F) in let f := factor_is F in
  let m := ranks 0 (eliminated f) (M.empty (nat * Z)) in let b := basis_rows ls own (how f) m in
  let gd := Zpos (Qden (decays F)) in let U := pull_rows ls gd r own b in let inside := marked C in
  let T := fold_right (fun i T => spread_row (by_times f) (add_row (- (Qnum (decays F) * ls * get r i)) (at_ U i) (b i)) (b i) T) none C in
  good ls (map wt own) && (0 <? by_times f)%Z && forallb (fun e : nat * Z => negb (snd e =? 0)%Z) (eliminated f) &&
  forallb (fun e => seen (tgt e) inside && seen (src e) inside) own && check_basis ls own C (how f) m &&
  nonnegative (length (eliminated f)) T (by_squares f) (columns_of f) (spread f).

(** * Sums over a group *)
Lemma fsum_one C t (f : nat -> R) : NoDup C -> In t C -> fsum C (fun i => if (t =? i)%nat then f i else 0) = f t.
Proof.
  induction C as [|a C IH]; intros N H; [destruct H|]. inversion N; subst. simpl. destruct (Nat.eqb_spec t a) as [->|Ne].
  - rewrite (fsum_ext C _ (fun _ => 0 * 1)); [rewrite fsum_scal; ring|]. intros i Hi. destruct (Nat.eqb_spec a i); [subst; contradiction|ring].
  - destruct H as [H|H]; [congruence|]. rewrite IH by assumption. ring.
Qed.
Lemma fsum_edges C own (f : edge -> R) (h : nat -> R) : NoDup C -> (forall e, In e own -> In (tgt e) C) ->
  fsum C (fun i => h i * esum own (fun e => if (tgt e =? i)%nat then f e else 0)) = esum own (fun e => h (tgt e) * f e).
Proof.
  intros N. induction own as [|e own IH]; intros H; simpl.
  - rewrite (fsum_ext C _ (fun _ => 0 * 1)) by (intros; ring). rewrite fsum_scal. ring.
  - rewrite <- IH by (intros; apply H; right; assumption). rewrite <- (fsum_one C (tgt e) (fun i => h i * f e) N) by (apply H; left; reflexivity).
    rewrite <- fsum_plus. apply fsum_ext. intros i _. destruct (tgt e =? i)%nat; ring.
Qed.
Lemma fsum_sub l C (f : nat -> R) : NoDup l -> NoDup C -> (forall i, In i C -> In i l) ->
  fsum l (fun i => if mem i C then f i else 0) = fsum C f.
Proof.
  intros Nl. induction C as [|a C IH]; intros N H; simpl.
  - rewrite (fsum_ext _ _ (fun _ => 0 * 1)) by (intros; ring). rewrite fsum_scal. ring.
  - inversion N; subst. rewrite <- IH, <- (fsum_one l a f Nl) by (auto; try (intros; apply H; right; assumption); apply H; left; reflexivity).
    rewrite <- fsum_plus. apply fsum_ext. intros i _. rewrite (Nat.eqb_sym a i). destruct (Nat.eqb_spec i a) as [->|Ne]; simpl.
    + destruct (mem a C) eqn:E; [apply mem_In in E; contradiction|ring].
    + destruct (mem i C); ring.
Qed.
Lemma marked_In C i : seen i (marked C) = true -> In i C. Proof. apply seen_marked. Qed.
Section Left.
Variables (own : list edge) (C : list nat) (eta : M.t Z).
Let ls := common (map wt own).
Hypothesis Hls : good ls (map wt own) = true.
Hypothesis Hin : forall e, In e own -> In (tgt e) C /\ In (src e) C.
Hypothesis HN : NoDup C.
Lemma weight e : In e own -> IZR (scaled ls (wt e)) = IZR ls * Q2R (wt e).
Proof. intros He. destruct (good_ok _ _ Hls) as [L G]. apply scaled_ok; [exact L|]. apply G. apply in_map. exact He. Qed.
Lemma weight_abs e : In e own -> IZR (Z.abs (scaled ls (wt e))) = IZR ls * Rabs (Q2R (wt e)).
Proof.
  intros He. destruct (good_ok _ _ Hls) as [L _]. apply IZR_lt in L. rewrite abs_IZR, (weight e He), Rabs_mult, (Rabs_right (IZR ls)) by lra. reflexivity.
Qed.
(** [lam'L], by node: [(lam'L) x = lam'(L x)] *)
Definition column (lam : nat -> R) (j : nat) : R := esum own (fun e =>
  (if (tgt e =? j)%nat then Rabs (Q2R (wt e)) * lam (tgt e) else 0) - if (src e =? j)%nat then Q2R (wt e) * lam (tgt e) else 0).
Lemma column_ok lam x : fsum C (fun j => column lam j * x j) = fsum C (fun i => lam i * lap own x i).
Proof.
  unfold lap. rewrite (fsum_ext C (fun i => lam i * _)
    (fun i => lam i * esum own (fun e => if (tgt e =? i)%nat then Rabs (Q2R (wt e)) * x (tgt e) - Q2R (wt e) * x (src e) else 0))).
  2: { intros i _. f_equal. unfold esum. clear. induction own as [|e l IH]; simpl; [reflexivity|]. rewrite IH. unfold lap_edge.
       destruct (Nat.eqb_spec (tgt e) i) as [<-|]; ring. }
  rewrite (fsum_edges C own (fun e => Rabs (Q2R (wt e)) * x (tgt e) - Q2R (wt e) * x (src e)) lam HN (fun e He => proj1 (Hin e He))).
  unfold column. clear ls Hls. revert Hin. induction own as [|e l IH]; intros Hl; simpl.
  - rewrite (fsum_ext C _ (fun _ => 0 * 1)) by (intros; ring). rewrite fsum_scal. ring.
  - rewrite <- IH by (intros; apply Hl; right; assumption). destruct (Hl e ltac:(left; reflexivity)) as [A B].
    transitivity (fsum C (fun i => if (tgt e =? i)%nat then Rabs (Q2R (wt e)) * lam (tgt e) * x i else 0) +
      fsum C (fun i => if (src e =? i)%nat then - (Q2R (wt e) * lam (tgt e) * x i) else 0) +
      fsum C (fun j => esum l (fun e => (if (tgt e =? j)%nat then Rabs (Q2R (wt e)) * lam (tgt e) else 0) - (if (src e =? j)%nat then Q2R (wt e) * lam (tgt e) else 0)) * x j)).
    + rewrite <- !fsum_plus. apply fsum_ext. intros i _. fold (esum l). destruct (tgt e =? i)%nat, (src e =? i)%nat; unfold esum; ring.
    + rewrite (fsum_one C (tgt e) (fun i => Rabs (Q2R (wt e)) * lam (tgt e) * x i) HN A), (fsum_one C (src e) (fun i => - (Q2R (wt e) * lam (tgt e) * x i)) HN B). fold (esum l). unfold esum. ring.
Qed.
Lemma left_entry j : IZR (get (left_product ls own eta) j) = IZR ls * column (fun i => IZR (get eta i)) j.
Proof.
  assert (G : forall l, (forall e, In e l -> In e own) -> IZR (get (left_product ls l eta) j) = IZR ls * esum l (fun e =>
    (if (tgt e =? j)%nat then Rabs (Q2R (wt e)) * IZR (get eta (tgt e)) else 0) - if (src e =? j)%nat then Q2R (wt e) * IZR (get eta (tgt e)) else 0)).
  { induction l as [|e l IH]; intros Hl; [simpl; rewrite get_empty; simpl; ring|].
    cbn [left_product fold_right esum]. cbv zeta. fold (left_product ls l eta) (esum l). rewrite !get_bump.
    specialize (IH ltac:(intros; apply Hl; right; assumption)). assert (He : In e own) by (apply Hl; left; reflexivity).
    pose proof (weight e He) as W. pose proof (weight_abs e He) as W'. unfold esum in *.
    destruct (tgt e =? j)%nat, (src e =? j)%nat; rewrite ?plus_IZR, ?opp_IZR, ?mult_IZR, ?W, ?W', IH; ring. }
  apply G. auto.
Qed.
Lemma left_ok x : fsum C (fun j => IZR (get (left_product ls own eta) j) * x j) = IZR ls * fsum C (fun i => IZR (get eta i) * lap own x i).
Proof. rewrite <- column_ok, <- fsum_scal. apply fsum_ext. intros j _. rewrite left_entry. ring. Qed.
End Left.

(** * The basis *)
Lemma ranks_find l : forall k m i a s, M.find i (ranks k l m) = Some (a, s) ->
  (k <= a < k + length l /\ nth_error l (a - k) = Some (i, s))%nat \/ M.find i m = Some (a, s).
Proof.
  induction l as [|[j v] l IH]; intros k m i a s H; simpl in H; [right; exact H|].
  destruct (IH _ _ _ _ _ H) as [[A B]|A].
  - left. simpl. split; [lia|]. destruct (a - k)%nat as [|q] eqn:E; [lia|]. simpl. replace (a - S k)%nat with q in B by lia. exact B.
  - rewrite Table.F.add_o in A. destruct (OrderedTypeEx.Nat_as_OT.eq_dec j i) as [->|N]; [|right; exact A].
    injection A as <- <-. left. simpl. split; [lia|]. rewrite Nat.sub_diag. reflexivity.
Qed.
Section Terms.
Variable l : list (nat * Z).
Hypothesis Hl : forallb (fun e : nat * Z => negb (snd e =? 0)%Z) l = true.
Let m := ranks 0 l (M.empty (nat * Z)).
Definition at_place (c : nat -> R) (k : nat) : R := match nth_error l k with Some e => c (fst e) / IZR (snd e) | None => 0 end.
Lemma at_place_out c k : (length l <= k)%nat -> at_place c k = 0.
Proof. intros H. unfold at_place. rewrite (proj2 (nth_error_None l k) H). reflexivity. Qed.
Lemma term_ok c i : placed m i = true \/ c i = 0 -> along (term m i) (at_place c) = c i.
Proof.
  unfold placed, term. destruct (M.find i m) as [[k s]|] eqn:E.
  - intros _. apply ranks_find in E as [[_ B]|B]; [|rewrite Table.F.empty_o in B; discriminate]. rewrite Nat.sub_0_r in B.
    simpl. unfold at_place. rewrite B. cbn [fst snd]. rewrite forallb_forall in Hl. pose proof (Hl _ (nth_error_In _ _ B)) as N.
    apply negb_true_iff, Z.eqb_neq in N. cbn [snd] in N. apply not_0_IZR in N. field. exact N.
  - intros [H|H]; [discriminate|]. simpl. rewrite H. reflexivity.
Qed.
End Terms.
(** edges of a tree, each with a multiple of its column *)
Definition hop_sum (eta c : nat -> R) (hops : list (nat * nat)) (i : nat) : R :=
  fold_right (fun h a => c (fst h) * (eta (fst h) * eta (snd h)) * ((if (fst h =? i)%nat then 1 else 0) - (if (snd h =? i)%nat then 1 else 0)) + a) 0 hops.
Lemma hop_ok root hops (eta : nat -> R) : (forall h, In h hops -> eta (fst h) <> 0 /\ eta (snd h) <> 0) -> forall s,
  fold_right hop (Some (M.add root tt (M.empty Datatypes.unit))) hops = Some s ->
  (forall i, seen i s = true <-> i = root \/ In i (map fst hops)) /\ NoDup (root :: map fst hops) /\
  forall u, (forall i, seen i s = false -> u i = 0) -> fsum (root :: map fst hops) u = 0 -> exists c, forall i, u i = hop_sum eta c hops i.
Proof.
  induction hops as [|[a q] hops IH]; intros He s H; simpl in H.
  - injection H as <-. split; [|split].
    + intros i. rewrite seen_add. unfold seen. rewrite Table.F.empty_a, orb_false_r, Nat.eqb_eq. simpl. intuition.
    + constructor; [auto|constructor].
    + intros u Hu S. exists (fun _ => 0). intros i. simpl in *. destruct (Nat.eq_dec i root) as [->|N]; [lra|]. apply Hu. rewrite seen_add.
      unfold seen. rewrite Table.F.empty_a, orb_false_r. apply Nat.eqb_neq. congruence.
  - destruct (fold_right hop _ hops) as [s'|] eqn:E; [|discriminate]. simpl in H.
    destruct (IH ltac:(intros h Hh; apply He; right; exact Hh) s' eq_refl) as [I1 [I2 I3]].
    destruct (seen q s') eqn:Eq; [|discriminate]. destruct (seen a s') eqn:Ea; [discriminate|]. injection H as <-.
    assert (Na : a <> root /\ ~ In a (map fst hops)) by (split; intros K; rewrite (proj2 (I1 a)) in Ea by auto; discriminate).
    assert (Nq : a <> q) by (intros ->; congruence).
    split; [|split].
    + intros i. rewrite seen_add, orb_true_iff, I1, Nat.eqb_eq. simpl. intuition.
    + inversion I2; subst. simpl. constructor; [simpl; intuition congruence|]. constructor; [tauto|assumption].
    + intros u Hu S. destruct (He (a, q) (or_introl eq_refl)) as [Ha Hq]. cbn [fst snd] in Ha, Hq.
      set (u' := fun i => if (i =? a)%nat then 0 else if (i =? q)%nat then u q + u a else u i).
      destruct (I3 u') as [c Hc].
      * intros i Hi. unfold u'. destruct (Nat.eqb_spec i a) as [->|Ni]; [reflexivity|]. destruct (Nat.eqb_spec i q) as [->|Niq]; [congruence|].
        apply Hu. rewrite seen_add, Hi, orb_false_r. apply Nat.eqb_neq. congruence.
      * transitivity (fsum (root :: map fst hops) u + u a); [|simpl in S |- *; lra].
        assert (Inq : In q (root :: map fst hops)) by (apply I1 in Eq as [->|Eq]; [left; reflexivity|right; exact Eq]).
        rewrite <- (fsum_one _ q (fun _ => u a) I2 Inq), <- fsum_plus. apply fsum_ext. intros i Hi. unfold u'. rewrite (Nat.eqb_sym i q).
        destruct (Nat.eqb_spec i a) as [->|Ni]; [destruct Hi as [Hi|Hi]; [destruct Na; congruence|tauto]|].
        destruct (Nat.eqb_spec q i) as [->|]; ring.
      * exists (fun i => if (i =? a)%nat then u a / (eta a * eta q) else c i). intros i. cbn [hop_sum fold_right fst snd].
        rewrite Nat.eqb_refl. replace (u a / (eta a * eta q) * (eta a * eta q)) with (u a) by (field; split; assumption).
        match goal with |- _ = _ + ?r => assert (R : r = hop_sum eta c hops i) end.
        { destruct Na as [_ Na]. clear - Na. induction hops as [|[k p] h IHh]; [reflexivity|]. cbn [hop_sum fold_right fst snd].
          simpl in Na. destruct (Nat.eqb_spec k a) as [->|]; [tauto|]. rewrite IHh by tauto. reflexivity. }
        rewrite R, <- (Hc i). unfold u'. destruct (Nat.eqb_spec i a) as [->|Ni].
        -- rewrite Nat.eqb_refl. destruct (Nat.eqb_spec q a); [congruence|]. ring.
        -- rewrite (Nat.eqb_sym i q). destruct (Nat.eqb_spec a i); [congruence|]. destruct (Nat.eqb_spec q i) as [->|]; ring.
Qed.

Lemma lap_times es a x i : lap es (fun j => a * x j) i = a * lap es x i.
Proof. unfold lap. induction es as [|e es IH]; simpl; [ring|]. rewrite IH. unfold lap_edge. destruct (tgt e =? i)%nat; ring. Qed.
Section Span.
Variables (own : list edge) (C : list nat) (l : list (nat * Z)) (b : basis).
Let ls := common (map wt own).
Let m := ranks 0 l (M.empty (nat * Z)).
Hypothesis Hl : forallb (fun e : nat * Z => negb (snd e =? 0)%Z) l = true.
Hypothesis Hls : good ls (map wt own) = true.
Hypothesis Hin : forall e, In e own -> In (tgt e) C /\ In (src e) C.
Hypothesis HN : NoDup C.
Hypothesis H : check_basis ls own C b m = true.
Lemma span x : exists c beta, beta <> 0 /\ forall i, In i C -> along (basis_rows ls own b m i) (at_place l c) = beta * lap own x i.
Proof.
  pose proof (weight own Hls) as We. pose proof (weight_abs own Hls) as Wa. fold ls in We, Wa.
  destruct (good_ok _ _ Hls) as [L0 _]. apply IZR_lt in L0. fold ls in L0. destruct b as [|root g0|root eta0 hops]; cbn [check_basis basis_rows] in *.
  - exists (lap own x), 1. split; [lra|]. intros i Hi. rewrite forallb_forall in H. rewrite (term_ok l Hl); [ring|left; apply H; exact Hi].
  - set (g := by_node g0) in *. apply andb_prop in H as [H' H3]. apply andb_prop in H' as [H1 H2]. apply Z.eqb_eq in H1.
    rewrite forallb_forall in H2, H3. apply (f_equal IZR) in H1. rewrite mult_IZR in H1.
    set (G := fun i => IZR (get g i)). set (c := fun i => x i + - (G root * x root) * G i).
    assert (Cr : c root = 0) by (unfold c; replace (x root + - (G root * x root) * G root) with (x root * (1 - G root * G root)) by ring; unfold G; rewrite H1; ring).
    exists c, (IZR ls). split; [lra|]. intros i Hi.
    assert (K : forall j, In j C -> along (term m j) (at_place l c) = c j).
    { intros j Hj. apply (term_ok l Hl). specialize (H2 j Hj). apply orb_prop in H2 as [A|A]; [left; exact A|right]. apply Nat.eqb_eq in A. subst. exact Cr. }
    assert (A : along (at_ (pinned_rows ls own m) i) (at_place l c) = IZR ls * lap own c i).
    { clear H3. assert (Q : forall es, (forall e, In e es -> In e own) -> along (at_ (pinned_rows ls es m) i) (at_place l c) = IZR ls * lap es c i).
      { induction es as [|e es IH]; intros Hes; [cbn [pinned_rows fold_right]; rewrite at_none; unfold lap; simpl; ring|].
        cbn [pinned_rows fold_right]. cbv zeta. fold (pinned_rows ls es m). assert (He : In e own) by (apply Hes; left; reflexivity).
        destruct (Hin e He) as [At As]. rewrite !along_at, IH by (intros; apply Hes; right; assumption).
        rewrite (K _ At), (K _ As), opp_IZR, (We e He), (Wa e He). unfold lap. cbn [fold_right]. unfold lap_edge at 2.
        destruct (Nat.eqb_spec (tgt e) i) as [->|]; fold ls; ring. }
      apply Q. auto. }
    rewrite A. f_equal. unfold c. rewrite lap_plus, lap_times. replace (lap own G i) with 0; [ring|].
    assert (Z : forall es, (forall e, In e es -> In e own) -> lap es G i = 0).
    { induction es as [|e es IH]; intros Hes; [reflexivity|]. unfold lap in *. cbn [fold_right].
      rewrite IH by (intros; apply Hes; right; assumption). assert (He : In e own) by (apply Hes; left; reflexivity).
      specialize (H3 e He). cbv zeta in H3. apply Z.eqb_eq, (f_equal IZR) in H3. rewrite !mult_IZR, (We e He), (Wa e He) in H3.
      fold ls in H3. unfold lap_edge. destruct (Nat.eqb_spec (tgt e) i) as [<-|]; [|ring]. fold (G (tgt e)) in H3. fold (G (src e)) in H3.
      apply (Rmult_eq_reg_l (IZR ls)); [lra|lra]. }
    symmetry. apply Z. auto.
  - set (eta := by_node eta0) in *. apply andb_prop in H as [H' H3]. apply andb_prop in H' as [H1 H2].
    destruct (fold_right hop _ hops) as [s|] eqn:E; [|discriminate]. rewrite forallb_forall in H1, H2, H3.
    set (et := fun i => IZR (get eta i)).
    assert (He : forall h, In h hops -> et (fst h) <> 0 /\ et (snd h) <> 0).
    { intros h Hh. specialize (H2 h Hh). apply andb_prop in H2 as [H2 B]. apply andb_prop in H2 as [_ A].
      apply negb_true_iff, Z.eqb_neq in A, B. split; apply not_0_IZR; assumption. }
    destruct (hop_ok root hops et He s E) as [I1 [I2 I3]].
    set (u := fun i => if mem i C then et i * lap own x i else 0).
    destruct (I3 u) as [c Hc].
    + intros i Hi. unfold u. destruct (mem i C) eqn:Em; [|reflexivity]. apply mem_In in Em. rewrite (H3 i Em) in Hi. discriminate.
    + unfold u. rewrite (fsum_sub _ C (fun i => et i * lap own x i) I2 HN).
      * apply (Rmult_eq_reg_l (IZR ls)); [|lra]. unfold et. rewrite Rmult_0_r. fold ls. unfold ls. rewrite <- (left_ok own C eta Hls Hin HN).
        rewrite (fsum_ext C _ (fun _ => 0 * 1)); [rewrite fsum_scal; ring|]. intros i Hi. specialize (H1 i Hi). apply andb_prop in H1 as [A _].
        apply Z.eqb_eq in A. fold ls. rewrite A. ring.
      * intros i Hi. specialize (H3 i Hi). apply I1 in H3 as [->|H3]; [left; reflexivity|right; exact H3].
    + exists c, 1. split; [lra|]. intros i Hi. specialize (H1 i Hi). apply andb_prop in H1 as [_ A]. apply negb_true_iff, Z.eqb_neq, not_0_IZR in A.
      fold (et i) in A. apply (Rmult_eq_reg_l (et i)); [|exact A]. rewrite Rmult_1_l.
      assert (Eu : et i * lap own x i = u i) by (unfold u; rewrite (proj2 (mem_In i C) Hi); reflexivity). rewrite Eu, Hc.
      clear - H2 Hl. unfold m, et. induction hops as [|[k q] h IH]; [cbn [tree_rows fold_right]; rewrite at_none; simpl; ring|].
      cbn [tree_rows hop_sum fold_right fst snd]. fold (tree_rows eta h m) (tree_rows eta h (ranks 0 l (M.empty (nat * Z)))).
      fold (hop_sum (fun i => IZR (get eta i)) c h i).
      assert (P : along (term (ranks 0 l (M.empty (nat * Z))) k) (at_place l c) = c k).
      { apply (term_ok l Hl). left. specialize (H2 (k, q) (or_introl eq_refl)). apply andb_prop in H2 as [H2 _]. apply andb_prop in H2 as [H2 _]. exact H2. }
      rewrite !along_at, P, Rmult_plus_distr_l, Rmult_plus_distr_l. rewrite IH by (intros; apply H2; right; assumption). rewrite opp_IZR.
      destruct (Nat.eqb_spec k i) as [->|], (Nat.eqb_spec q i) as [->|]; ring.
Qed.
End Span.

(** * The group *)
Section Fact.
Variables (own : list edge) (C : list nat) (F : fact).
Hypothesis HN : NoDup C.
Hypothesis H : check_factor own C F = true.
Let r (i : nat) := IZR (get (by_node (ratios F)) i).
Theorem factor_ok x : let z := lap own x in
  Q2R (decays F) * fsum C (fun i => r i * sq (z i)) <=
  2 * esum own (fun e => r (tgt e) * (z (tgt e) * (Rabs (Q2R (wt e)) * z (tgt e) - Q2R (wt e) * z (src e)))).
Proof.
  intros z. unfold check_factor in H. cbv zeta in H. set (ls := common (map wt own)) in *. set (R := by_node (ratios F)) in *. set (f := factor_is F) in *.
  set (m := ranks 0 (eliminated f) _) in *. set (b := basis_rows ls own (how f) m) in *. set (gd := Zpos (Qden (decays F))) in *.
  set (gn := Qnum (decays F)) in *. set (U := pull_rows ls gd R own b) in *. set (T := fold_right _ none C) in *. set (n := length (eliminated f)) in *.
  apply andb_prop in H as [H' H6]. apply andb_prop in H' as [H' H5]. apply andb_prop in H' as [H' H4]. apply andb_prop in H' as [H' H3].
  apply andb_prop in H' as [H1 H2]. apply Z.ltb_lt, IZR_lt in H2. rewrite forallb_forall in H4.
  assert (Hin : forall e, In e own -> In (tgt e) C /\ In (src e) C).
  { intros e He. specialize (H4 e He). apply andb_prop in H4 as [A B]. split; apply marked_In; assumption. }
  destruct (span own C (eliminated f) (how f) H3 H1 Hin HN H5 x) as [c [beta [B0 Hb]]]. fold ls m b z in Hb.
  pose proof (weight own H1) as We. pose proof (weight_abs own H1) as Wa. fold ls in We, Wa.
  set (y := at_place (eliminated f) c) in *.
  assert (Hy : forall a, (n <= a)%nat -> y a = 0) by (intros a Ha; apply at_place_out; exact Ha).
  pose proof (nonnegative_ok n T _ _ _ y H6 Hy) as P.
  set (pull := fun e => 2 * (r (tgt e) * (Rabs (Q2R (wt e)) * z (tgt e) - Q2R (wt e) * z (src e)))).
  assert (EU : forall i, along (at_ U i) y = IZR ls * IZR gd * beta * esum own (fun e => if (tgt e =? i)%nat then pull e else 0)).
  { intros i. unfold U. assert (Q : forall es, (forall e, In e es -> In e own) -> along (at_ (pull_rows ls gd R es b) i) y =
      IZR ls * IZR gd * beta * esum es (fun e => if (tgt e =? i)%nat then pull e else 0)).
    { induction es as [|e es IH]; intros Hes; [cbn [pull_rows fold_right]; rewrite at_none; simpl; ring|].
      cbn [pull_rows fold_right esum]. cbv zeta. fold (pull_rows ls gd R es b). assert (He : In e own) by (apply Hes; left; reflexivity).
      destruct (Hin e He) as [At As]. rewrite !along_at, IH by (intros; apply Hes; right; assumption).
      rewrite (Hb _ At), (Hb _ As), opp_IZR, !mult_IZR, (We e He), (Wa e He). fold ls. unfold esum.
      assert (Ep : pull e = 2 * (IZR (get R (tgt e)) * (Rabs (Q2R (wt e)) * z (tgt e) - Q2R (wt e) * z (src e)))) by reflexivity. rewrite Ep.
      destruct (tgt e =? i)%nat; ring. }
    apply Q. auto. }
  assert (ET : form_of n (at_ T) y = IZR (by_times f) * (beta * beta) * IZR ls *
    (IZR gd * fsum C (fun i => z i * esum own (fun e => if (tgt e =? i)%nat then pull e else 0)) - IZR gn * fsum C (fun i => r i * sq (z i)))).
  { assert (Q : forall D T0, (forall i, In i D -> In i C) -> T0 = fold_right (fun i T => spread_row (by_times f) (add_row (- (gn * ls * get R i)) (at_ U i) (b i)) (b i) T) none D ->
      form_of n (at_ T0) y = IZR (by_times f) * (beta * beta) * IZR ls *
      (IZR gd * fsum D (fun i => z i * esum own (fun e => if (tgt e =? i)%nat then pull e else 0)) - IZR gn * fsum D (fun i => r i * sq (z i)))).
    { clear P H6. induction D as [|i D IH]; intros T0 HD ->; [cbn [fold_right fsum]; rewrite (form_none n y); ring|]. cbn [fold_right].
      match goal with |- context [spread_row _ _ _ ?t] => set (T1 := t) in * end. specialize (IH T1 ltac:(intros; apply HD; right; assumption) eq_refl).
      assert (ES : forall t u k T, form_of n (at_ (spread_row t u k T)) y = form_of n (at_ T) y + IZR t * (along k y * along u y)).
      { intros t u k. induction k as [|[a v] k IHk]; intros T2; cbn [spread_row fold_right along fst snd]; [ring|].
        fold (spread_row t u k T2). rewrite (form_add n y Hy), IHk, mult_IZR. ring. }
      rewrite ES, IH, along_add, EU, (Hb i) by (apply HD; left; reflexivity). rewrite opp_IZR, !mult_IZR. cbn [fsum fold_right].
      unfold r at 2. fold R. unfold sq at 2. unfold fsum. ring. }
    apply (Q C T (fun i Hi => Hi) eq_refl). }
  rewrite ET in P. rewrite (fsum_edges C own pull z HN (fun e He => proj1 (Hin e He))) in P.
  destruct (good_ok _ _ H1) as [L0 _]. apply IZR_lt in L0. fold ls in L0.
  assert (K : 0 < IZR (by_times f) * (beta * beta) * IZR ls).
  { apply Rmult_lt_0_compat; [apply Rmult_lt_0_compat; [exact H2|]|exact L0]. pose proof (Rsqr_pos_lt beta B0) as S. unfold Rsqr in S. exact S. }
  assert (P' : 0 <= IZR gd * esum own (fun e => z (tgt e) * pull e) - IZR gn * fsum C (fun i => r i * sq (z i))).
  { apply (Rmult_le_reg_l _ _ _ K). rewrite Rmult_0_r. exact P. }
  assert (Gd : 0 < IZR gd) by (apply IZR_lt; reflexivity).
  assert (Ep : esum own (fun e => z (tgt e) * pull e) = 2 * esum own (fun e => r (tgt e) * (z (tgt e) * (Rabs (Q2R (wt e)) * z (tgt e) - Q2R (wt e) * z (src e))))).
  { unfold esum. clearbody z. clear - r. induction own as [|e l IH]; cbn [fold_right]; [ring|]. rewrite IH. unfold pull. ring. }
  rewrite Ep in P'. unfold Q2R at 1. fold gn gd. set (s1 := fsum C _) in *. set (s2 := 2 * esum own _) in *.
  apply (Rmult_le_reg_l (IZR gd)); [exact Gd|]. replace (IZR gd * (IZR gn * / IZR gd * s1)) with (IZR gn * s1) by (field; lra). lra.
Qed.
End Fact.
(** weights [p], as integers by node, are in the ratios of a fact *)
Definition fits (F : fact) (k : nat) (C : list nat) (P : M.t Z) (g : Q) : bool :=
  (whose F =? k)%nat && Qeq_bool (decays F) g && let r := by_node (ratios F) in
  match C with [] => false | h :: _ => (0 <? get r h)%Z && (0 <=? get P h)%Z &&
    forallb (fun i => get P i * get r h =? get P h * get r i)%Z C end.
Lemma fact_ok es own C F k p g x : NoDup C -> (forall i, In i C -> forall y, lap own y i = lap es y i) -> check_factor own C F = true ->
  good (common p) p = true -> fits F k C (table (map (scaled (common p)) p)) g = true -> let z := lap es x in
  Q2R g * fsum C (fun i => Q2R (nth i p 0%Q) * sq (z i)) <= 2 * esum own (half_edge p z).
Proof.
  intros HN HL H Gp HF z. pose proof (factor_ok own C F HN H x) as R. cbv zeta in R.
  assert (Hin : forall e, In e own -> In (tgt e) C /\ In (src e) C).
  { unfold check_factor in H. cbv zeta in H. apply andb_prop in H as [H _]. apply andb_prop in H as [H _]. apply andb_prop in H as [_ H].
    rewrite forallb_forall in H. intros e He. specialize (H e He). apply andb_prop in H as [A B]. split; apply marked_In; assumption. }
  unfold fits in HF. cbv zeta in HF. set (P := table _) in HF. set (r := by_node (ratios F)) in *. apply andb_prop in HF as [HF H3].
  apply andb_prop in HF as [_ H2]. apply Qeq_bool_eq, Qeq_eqR in H2. rewrite H2 in R.
  destruct C as [|h C0] eqn:EC; [discriminate|]. rewrite <- EC in *. clear EC C0.
  apply andb_prop in H3 as [H3 H5]. apply andb_prop in H3 as [H3 H4]. apply Z.ltb_lt, IZR_lt in H3. apply Z.leb_le, IZR_le in H4. rewrite forallb_forall in H5.
  destruct (good_ok _ _ Gp) as [L _]. apply IZR_lt in L.
  assert (EP : forall i, IZR (get P i) = IZR (common p) * Q2R (nth i p 0%Q)) by (intros i; unfold P; rewrite get_table; apply nth_scaled; exact Gp).
  set (tau := IZR (get P h) / (IZR (common p) * IZR (get r h))).
  assert (K : 0 < IZR (common p) * IZR (get r h)) by (apply Rmult_lt_0_compat; assumption).
  assert (T0 : 0 <= tau) by (unfold tau; apply Rmult_le_pos; [exact H4|left; apply Rinv_0_lt_compat; exact K]).
  assert (Ep : forall i, In i C -> Q2R (nth i p 0%Q) = tau * IZR (get r i)).
  { intros i Hi. specialize (H5 i Hi). apply Z.eqb_eq, (f_equal IZR) in H5. rewrite !mult_IZR, (EP i) in H5. unfold tau.
    apply (Rmult_eq_reg_l (IZR (common p) * IZR (get r h))); [|lra]. field_simplify; [lra|lra]. }
  apply (Rmult_le_compat_l _ _ _ T0) in R.
  rewrite (fsum_ext C _ (fun i => tau * (IZR (get r i) * sq (lap own x i)))).
  2: { intros i Hi. rewrite (Ep i Hi). unfold z. rewrite (HL i Hi). ring. }
  rewrite fsum_scal. rewrite (esum_ext own (half_edge p z) (fun e => tau * (IZR (get r (tgt e)) * (lap own x (tgt e) *
    (Rabs (Q2R (wt e)) * lap own x (tgt e) - Q2R (wt e) * lap own x (src e)))))).
  2: { intros e He. destruct (Hin e He) as [At As]. unfold half_edge, z. rewrite (Ep _ At), (HL _ At), (HL _ As). ring. }
  assert (ES : forall f l, esum l (fun e => tau * f e) = tau * esum l f) by (intros f l; induction l as [|e l IH]; simpl; [ring|rewrite IH; ring]).
  rewrite ES. set (s1 := fsum C _) in *. set (s2 := esum own _) in *. lra.
Qed.
