(** What becomes of a component depends on the signal: a state that is at rest in one mandatory graph lies near a stated one,
    and moves in another mandatory graph, or where one weight has the other end of its interval; with [FamilyDepends.v] all
    that the check of such components means. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Claims Mean Table Dominance Rest Wide FamilyCertificate FamilyChecker
  FamilySound FamilyMotion FamilyRows FamilyRest FamilyNear FamilyDepends.
Open Scope R_scope.

Lemma Qabs_R q : Q2R (Qabs q) = Rabs (Q2R q).
Proof.
  unfold Q2R. destruct q as [a d]. simpl. rewrite Rabs_mult, abs_IZR. f_equal. symmetry. apply Rabs_right. apply Rle_ge. left.
  apply Rinv_0_lt_compat. apply IZR_lt. reflexivity.
Qed.
Lemma less_R a b : less a b = true -> Q2R a < Q2R b.
Proof.
  unfold less. intros H. apply negb_true_iff in H. apply Rnot_le_lt. intros L. apply Rle_Qle in L. apply Qle_bool_iff in L. congruence.
Qed.
Definition into (es : list edge) (g : edge -> R) (i : nat) : R := esum es (fun e => if (tgt e =? i)%nat then g e else 0).
Lemma row_of_R es g i : Q2R (row_of es g i) = into es (fun e => Q2R (g e)) i.
Proof.
  unfold row_of, into, esum. induction es as [|e es IH]; cbn [fold_right]; [apply Q2R_0|]. destruct (tgt e =? i)%nat; [|rewrite IH; ring].
  rewrite Qred_R, Q2R_plus, IH. reflexivity.
Qed.
Lemma into_le es g h i : (forall e, In e es -> tgt e = i -> g e <= h e) -> into es g i <= into es h i.
Proof.
  intros H. apply esum_le. intros e He. destruct (Nat.eqb_spec (tgt e) i) as [E|_]; [apply H; assumption|apply Rle_refl].
Qed.
Lemma into_minus es g h i : into es (fun e => g e - h e) i = into es g i - into es h i.
Proof. unfold into. induction es as [|e es IH]; simpl; [ring|]. rewrite IH. destruct (tgt e =? i)%nat; ring. Qed.
Lemma into_null es g i : (forall e, In e es -> tgt e = i -> g e = 0) -> into es g i = 0.
Proof.
  intros H. unfold into. induction es as [|e es IH]; simpl; [reflexivity|]. rewrite IH by (intros; apply H; [right|]; assumption).
  destruct (Nat.eqb_spec (tgt e) i) as [E|_]; [rewrite (H e) by (auto; left; reflexivity)|]; ring.
Qed.
Lemma lap_into es x i : lap es x i = into es (fun e => Rabs (Q2R (wt e)) * x (tgt e) - Q2R (wt e) * x (src e)) i.
Proof.
  rewrite lap_esum. apply esum_ext. intros e _. unfold lap_edge. destruct (Nat.eqb_spec (tgt e) i) as [->|_]; reflexivity.
Qed.
(** one weight has another value *)
Definition upd (w : nat -> R) (j : nat) (v : R) : nat -> R := fun i => if (i =? j)%nat then v else w i.
Lemma member_upd l : forall j e w v x i, nth_error l j = Some e -> member l (upd w j v) x i = member l w x i - pulls e (w j) x i + pulls e v x i.
Proof.
  induction l as [|e' l IH]; intros [|j] e w v x i E; try discriminate; cbn [member].
  - injection E as <-. replace (member l (shift (upd w 0 v)) x i) with (member l (shift w) x i) by reflexivity. unfold upd. simpl. ring.
  - replace (member l (shift (upd w (S j) v)) x i) with (member l (upd (shift w) j v) x i) by reflexivity.
    rewrite (IH j e (shift w) v x i E). unfold upd, shift. simpl. ring.
Qed.

Section Counter.
Variables (F : family) (P : part).
Let n := order (frame F).
Let C := its_agents P.
Hypothesis Hmodes : forallb (check_mode F) (modes F) = true.
Hypothesis Hpart : check_part F P = true.
Hypothesis Hbasis : check_pivots F P = true.
Variables (xs rs : list Q).
Let x (i : nat) : R := Q2R (entry xs i).
Let r (i : nat) : R := Q2R (entry rs i).

Section State.
Variable m : mode.
Hypothesis Hm : In m (modes F).
Let es := edges (mandatory m).
Lemma inside_ e : In e es -> In (tgt e) C -> In (src e) C.
Proof. intros He. apply (part_inside F P Hmodes Hpart m e Hm He). Qed.
Lemma rows_R i : Q2R (row_of es (moved xs) i) = lap es x i /\
  Q2R (row_of es (drawn_in rs) i) = into es (fun e => Rabs (Q2R (wt e)) * (r (tgt e) - r (src e))) i /\
  Q2R (row_of es (blurred rs) i) = into es (fun e => Rabs (Q2R (wt e)) * (r (tgt e) + r (src e))) i.
Proof.
  rewrite !row_of_R, lap_into. unfold moved, drawn_in, blurred. split; [|split]; apply esum_ext; intros e _; destruct (tgt e =? i)%nat; try reflexivity.
  - rewrite Q2R_minus, !Q2R_mult, Qabs_R. reflexivity.
  - rewrite Q2R_mult, Q2R_minus, Qabs_R. reflexivity.
  - rewrite Q2R_mult, Q2R_plus, Qabs_R. reflexivity.
Qed.
Hypothesis H : check_state P m xs rs = true.
Lemma state_parts i : In i C -> (leads m i = true -> r i = 0) /\
  Rabs (lap es x i) <= into es (fun e => Rabs (Q2R (wt e)) * (r (tgt e) - r (src e))) i.
Proof.
  intros Hi. pose proof H as K. unfold check_state in K. cbv zeta in K. rewrite forallb_forall in K. specialize (K i Hi). apply andb_prop in K as [A B].
  destruct (rows_R i) as [E1 [E2 _]]. apply Qle_R in B. fold es in B. rewrite Qabs_R, E1, E2 in B. split; [|exact B].
  intros L. rewrite L in A. simpl in A. apply Qeq_R in A. rewrite Q2R_0 in A. exact A.
Qed.
Theorem near_state : exists q, (forall i, ~ In i C -> q i = 0) /\ (forall i, lap es q i = 0) /\ forall i, In i C -> Rabs (q i - x i) <= r i.
Proof.
  set (tau := fun i => if in_dec Nat.eq_dec i C then x i else 0).
  assert (Tx : forall i, In i C -> tau i = x i) by (intros i Hi; unfold tau; destruct (in_dec Nat.eq_dec i C); [reflexivity|contradiction]).
  assert (T0 : forall i, ~ In i C -> tau i = 0) by (intros i Hi; unfold tau; destruct (in_dec Nat.eq_dec i C); [contradiction|reflexivity]).
  assert (Lead : forall e, In e es -> In (tgt e) C -> leads m (tgt e) = true -> leads m (src e) = true).
  { intros e He Ht L. pose proof (outside F P Hmodes Hpart Hbasis m Hm e He) as O.
    destruct (leads m (src e)) eqn:Ls; [reflexivity|]. exfalso. apply O.
    - intros I. apply (followers_ok F P Hbasis m) in I as [_ I]. congruence.
    - apply (followers_ok F P Hbasis m). split; [apply inside_; assumption|exact Ls]. }
  destruct (dirichlet F P Hmodes Hpart Hbasis m Hm tau T0) as [q [Q1 Q2]].
  { intros i Hi L. change (lap es tau i = 0). rewrite (lap_same es tau x i) by (intros e He Et; subst i; split; apply Tx; [exact Hi|apply inside_; assumption]).
    destruct (state_parts i Hi) as [_ B]. rewrite into_null in B.
    - apply no_size. exact B.
    - intros e He Et. subst i. pose proof (inside_ e He Hi) as Hs. rewrite (proj1 (state_parts _ Hi) L), (proj1 (state_parts _ Hs) (Lead e He Hi L)). ring. }
  change (forall i, lap es q i = 0) in Q2. exists q. split; [|split; [exact Q2|]].
  { intros i Hi. rewrite (Q1 i); [apply T0; exact Hi|]. intros I. apply (followers_ok F P Hbasis m) in I as [I _]. contradiction. }
  set (d := fun i => q i - x i). set (u := fun i => Rabs (d i) - r i).
  assert (Row : forall i, In i C -> into es (fun e => Rabs (Q2R (wt e)) * (u (tgt e) - u (src e))) i <= 0).
  { intros i Hi. destruct (side_of (d i)) as [g [G1 G2]]. destruct (state_parts i Hi) as [_ B].
    assert (E : lap es d i = - lap es x i) by (unfold d; rewrite lap_minus, Q2; ring).
    assert (L1 : into es (fun e => Rabs (Q2R (wt e)) * (Rabs (d (tgt e)) - Rabs (d (src e)))) i <= g * lap es d i).
    { rewrite lap_into. unfold into. rewrite <- esum_scal. apply esum_le. intros e He. destruct (Nat.eqb_spec (tgt e) i) as [Et|_]; [|lra].
      rewrite Et, <- G2. set (w := Q2R (wt e)). assert (K : g * (w * d (src e)) <= Rabs w * Rabs (d (src e))).
      { rewrite <- Rabs_mult. pose proof (Rle_abs (w * d (src e))) as K1. pose proof (Rle_abs (- (w * d (src e)))) as K2. rewrite Rabs_Ropp in K2.
        destruct G1 as [-> | ->]; lra. }
      lra. }
    assert (L2 : g * lap es d i <= Rabs (lap es x i)).
    { rewrite E. pose proof (Rle_abs (lap es x i)). pose proof (Rle_abs (- lap es x i)) as K. rewrite Rabs_Ropp in K. destruct G1 as [-> | ->]; lra. }
    assert (E3 : into es (fun e => Rabs (Q2R (wt e)) * (u (tgt e) - u (src e))) i =
      into es (fun e => Rabs (Q2R (wt e)) * (Rabs (d (tgt e)) - Rabs (d (src e))) - Rabs (Q2R (wt e)) * (r (tgt e) - r (src e))) i).
    { apply esum_ext. intros e _. unfold u. destruct (tgt e =? i)%nat; ring. }
    rewrite E3, into_minus. lra. }
  intros i Hi. apply Rnot_lt_le. intros N.
  destruct (largest_of u C) as [b [Hb MB]]; [intros E; rewrite E in Hi; destruct Hi|]. set (M := u b) in *.
  assert (MP : 0 < M) by (pose proof (MB i Hi : u i <= M) as K; assert (u i = Rabs (q i - x i) - r i) by reflexivity; lra).
  assert (Up : forall a j, path es a j -> In j C -> u j = M -> u a = M /\ In a C).
  { intros a j Pa. induction Pa as [j|j e He Pa IH]; intros Hj E; [auto|]. pose proof (inside_ e He Hj) as Hs. apply IH; [exact Hs|].
    assert (Z : (if (tgt e =? tgt e)%nat then Rabs (Q2R (wt e)) * (u (tgt e) - u (src e)) else 0) = 0).
    { apply (terms_zero es (fun f => if (tgt f =? tgt e)%nat then Rabs (Q2R (wt f)) * (u (tgt f) - u (src f)) else 0)); [| |exact He].
      - intros f Hf. destruct (Nat.eqb_spec (tgt f) (tgt e)) as [Ef|_]; [|lra]. apply Rmult_le_pos; [apply Rabs_pos|]. rewrite Ef, E.
        pose proof (MB (src f) (inside_ f Hf ltac:(rewrite Ef; exact Hj))). lra.
      - apply Rle_antisym; [exact (Row (tgt e) Hj)|]. apply Rle_trans with (into es (fun _ => 0) (tgt e)).
        { rewrite into_null by reflexivity. apply Rle_refl. }
        apply into_le. intros f Hf Ef. apply Rmult_le_pos; [apply Rabs_pos|]. rewrite Ef, E.
        pose proof (MB (src f) (inside_ f Hf ltac:(rewrite Ef; exact Hj))). lra. }
    rewrite Nat.eqb_refl in Z. pose proof (Rabs_no_R0 _ (Hnz F P Hmodes Hpart m Hm e He)). apply Rmult_integral in Z as [Z|Z]; [contradiction|lra]. }
  destruct (mode_parts F Hmodes m Hm) as [En W]. destruct (wide_parts _ W) as [_ [_ [_ W3]]]. rewrite En in W3.
  destruct (W3 b (agents_in F P Hbasis b Hb)) as [D [HD [_ HP]]]. destruct (Up _ _ HP Hb eq_refl) as [Eh Hh].
  destruct (hd_in F Hmodes m Hm D HD) as [Ih _]. set (h := hd O (nodes D)) in *.
  assert (L : leads m h = true) by (apply leads_ok; exists D; auto).
  assert (Q0 : q h = x h). { rewrite (Q1 h); [apply Tx; exact Hh|]. intros I. apply (followers_ok F P Hbasis m) in I as [_ I]. congruence. }
  unfold u, d in Eh. rewrite Q0, (proj1 (state_parts h Hh) L) in Eh. replace (x h - x h) with 0 in Eh by ring. rewrite Rabs_R0 in Eh. lra.
Qed.
End State.

Theorem moved_ok m j q : In m (modes F) -> (forall i, In i C -> Rabs (q i - x i) <= r i) -> check_moved P m j xs rs = true ->
  exists w i, admits (ties m) w /\ In i C /\ member (ties m) w q i <> 0.
Proof.
  intros Hm HQ H. unfold check_moved in H. destruct (smallest_ok n (ties m) (ties_ok F Hmodes m Hm)) as [w [W1 W2]].
  destruct (modes_claim F Hmodes m Hm) as [Ee _]. destruct j as [j|].
  - destruct (nth_error (ties m) j) as [e|] eqn:Ej; [|discriminate]. apply andb_prop in H as [H H4]. apply andb_prop in H as [H H3].
    apply andb_prop in H as [H1 H2]. apply negb_true_iff, Nat.eqb_neq in H1. apply mem_In in H2. apply less_R in H3, H4.
    pose proof (proj1 (part_ties F P Hpart m e Hm (nth_error_In _ _ Ej)) H2) as H2'.
    set (sg := IZR (sign_of e)). rewrite Q2R_plus, Qabs_R, Q2R_minus, Q2R_mult in H4.
    assert (Es : Q2R (inject_Z (sign_of e)) = sg) by (unfold sg, Q2R, inject_Z; simpl; field). rewrite Es in H4.
    fold (x (head e)) (x (tail e)) (r (head e)) (r (tail e)) in H4.
    assert (Sg : sg = 1 \/ sg = -1) by (unfold sg, sign_of; destruct (positive e); auto).
    assert (Dq : q (head e) - sg * q (tail e) <> 0).
    { intros Z. pose proof (HQ _ H2) as A. pose proof (HQ _ H2') as B. apply Rabs_le_between in A, B.
      assert (K : Rabs (x (head e) - sg * x (tail e)) <= r (head e) + r (tail e)); [|lra]. apply Rabs_le. destruct Sg as [E|E]; rewrite E in *; lra. }
    assert (HT : Q2R (bottom e) <= Q2R (top e)).
    { unfold lo, hi in H3. destruct (positive e); [lra|]. rewrite !Q2R_opp in H3. lra. }
    assert (Ad : forall v, Q2R (bottom e) <= v <= Q2R (top e) -> admits (ties m) (upd w j v)).
    { intros v Hv i e' E. unfold upd. destruct (Nat.eqb_spec i j) as [->|_]; [|apply W1; exact E]. rewrite Ej in E. injection E as <-. exact Hv. }
    assert (Pu : forall v, v = sg * Rabs v -> pulls e v q (head e) = Rabs v * (q (head e) - sg * q (tail e))).
    { intros v Ev. unfold pulls, heard. rewrite Nat.eqb_refl. replace (tail e =? head e)%nat with false by (symmetry; apply Nat.eqb_neq; auto).
      rewrite Ev at 2. destruct (mutual e); ring. }
    assert (Ct : check_tie n e = true) by (pose proof (ties_ok F Hmodes m Hm) as K; rewrite forallb_forall in K; apply K; apply (nth_error_In _ _ Ej)).
    unfold check_tie in Ct. apply andb_prop in Ct as [Ct _]. apply andb_prop in Ct as [_ L0]. apply Qle_R in L0. rewrite Q2R_0 in L0.
    assert (Sizes : Q2R (bottom e) = sg * Rabs (Q2R (bottom e)) /\ Q2R (top e) = sg * Rabs (Q2R (top e)) /\ Rabs (Q2R (bottom e)) <> Rabs (Q2R (top e))).
    { unfold sg, sign_of, lo, hi in *. destruct (positive e).
      - rewrite !Rabs_right by lra. lra.
      - rewrite !Q2R_opp in *. rewrite !Rabs_left1 by lra. lra. }
    destruct Sizes as [S1 [S2 S3]].
    pose proof (member_upd (ties m) j e w (Q2R (bottom e)) q (head e) Ej) as M1. pose proof (member_upd (ties m) j e w (Q2R (top e)) q (head e) Ej) as M2.
    rewrite (Pu _ S1) in M1. rewrite (Pu _ S2) in M2.
    destruct (Req_dec (member (ties m) (upd w j (Q2R (bottom e))) q (head e)) 0) as [Z1|Z1].
    + exists (upd w j (Q2R (top e))), (head e). split; [apply Ad; lra|]. split; [exact H2|]. intros Z2. apply S3.
      apply (Rmult_eq_reg_r (q (head e) - sg * q (tail e))); [|exact Dq]. lra.
    + exists (upd w j (Q2R (bottom e))), (head e). split; [apply Ad; lra|]. split; [exact H2|exact Z1].
  - apply existsb_exists in H as [i [Hi H]]. apply less_R in H. destruct (rows_R m i) as [E1 [_ E3]]. rewrite Qabs_R, E1, E3 in H.
    exists w, i. split; [exact W1|]. split; [exact Hi|]. rewrite W2, <- Ee. set (es := edges (mandatory m)) in *. intros Z.
    assert (K : Rabs (lap es (fun i => q i - x i) i) <= into es (fun e => Rabs (Q2R (wt e)) * (r (tgt e) + r (src e))) i).
    { assert (G : forall g, g = 1 \/ g = -1 -> g * lap es (fun i => q i - x i) i <= into es (fun e => Rabs (Q2R (wt e)) * (r (tgt e) + r (src e))) i).
      { intros g Hg. rewrite lap_into. unfold into. rewrite <- esum_scal. apply esum_le. intros e He. destruct (Nat.eqb_spec (tgt e) i) as [Et|_]; [|lra].
        pose proof (HQ (tgt e) ltac:(rewrite Et; exact Hi)) as A. pose proof (HQ (src e) (inside_ m Hm e He ltac:(rewrite Et; exact Hi))) as B.
        set (a := q (tgt e) - x (tgt e)) in *. set (b := q (src e) - x (src e)) in *. set (w' := Q2R (wt e)).
        pose proof (Rabs_pos w'). assert (A1 : g * (Rabs w' * a) <= Rabs w' * r (tgt e)).
        { replace (g * (Rabs w' * a)) with (Rabs w' * (g * a)) by ring. apply Rmult_le_compat_l; [lra|]. apply sign_at_most; assumption. }
        assert (B1 : - (g * (w' * b)) <= Rabs w' * r (src e)).
        { assert (B0 : Rabs (w' * b) <= Rabs w' * r (src e)) by (rewrite Rabs_mult; apply Rmult_le_compat_l; assumption).
          apply Rabs_le_between in B0. destruct Hg as [-> | ->]; lra. }
        lra. }
      pose proof (G 1 ltac:(auto)). pose proof (G (-1) ltac:(auto)). apply Rabs_le. lra. }
    rewrite lap_minus, Z in K. replace (0 - lap es x i) with (- lap es x i) in K by ring. rewrite Rabs_Ropp in K. lra.
Qed.
End Counter.

Theorem depends_ok F P w : forallb (check_mode F) (modes F) = true -> check_part F P = true -> check_pivots F P = true ->
  check_depends F P w = true -> becomes P = Depends -> exists q m w i, switches F (fun _ => q) (fun _ _ => 0) /\ In m (modes F) /\
    admits (ties m) w /\ In i (its_agents P) /\ member (ties m) w q i <> 0.
Proof.
  intros Hmodes Hpart Hbasis H E. unfold check_depends in H. rewrite E in H. destruct w as [[a b|a b j xs rs]|]; [| |discriminate];
    (destruct (nth_error (modes F) a) as [m|] eqn:Ea; [|discriminate]); (destruct (nth_error (modes F) b) as [m'|] eqn:Eb; [|discriminate]);
    apply nth_error_In in Ea, Eb.
  - destruct (counts_ok F P Hmodes Hpart Hbasis m m' Ea Eb H) as [q [Q1 [i [Hi Q2]]]].
    destruct (smallest_ok _ _ (ties_ok F Hmodes m' Eb)) as [w [W1 W2]]. destruct (modes_claim F Hmodes m' Eb) as [Ee _].
    exists q, m', w, i. rewrite W2, <- Ee. auto.
  - apply andb_prop in H as [H1 H2]. destruct (near_state F P Hmodes Hpart Hbasis xs rs m Ea H1) as [q [_ [Q1 Q2]]].
    destruct (moved_ok F P Hmodes Hpart xs rs m' j q Eb Q2 H2) as [w [i [W [Hi Q3]]]]. exists q, m', w, i.
    split; [apply (rests F Hmodes m q Ea); intros; apply Q1|]. auto.
Qed.
