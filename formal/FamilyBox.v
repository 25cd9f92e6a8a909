(** Boxes: where every row points inwards on the sides of a box, agents stay in it, or are drawn to it, under every signal;
    and sliding variables that are 0 at first stay 0. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Graph Flow Certificate Checker Sound Input Slide Reach Rest FamilyCertificate FamilyFlow FamilyChecker FamilySound FamilyMotion FamilyRows.
Open Scope R_scope.

(** * The check *)
(** the least that the weights of an edge draw the agent [t] inwards at its upper end, what it hears being at its end *)
Definition gap (lo_ up : list Q) (e : tie) (t s : nat) : Q := worst e (entry up t - if positive e then entry up s else - entry lo_ s)%Q.
Definition check_side (F : family) (d lo_ up : list Q) (r : Q) : bool := forallb (fun i => Qeq_bool (entry d i) 0 || pos (entry d i) &&
  forallb (fun m => Qle_bool 0 (row_sum (ties m) (gap lo_ up) i) && Qle_bool (r * entry d i) (2 * row_sum (ties m) (drawn d) i)) (modes F))
  (seq 0 (order (frame F))).
Definition check_sides F d lo_ up r : bool := check_side F d lo_ up r && check_side F d (map Qopp up) (map Qopp lo_) r.
(** a box that holds all agents from the initial state on *)
Definition check_hull (F : family) (h : list Q * list Q) : bool := let n := order (frame F) in
  forallb (fun i => Qle_bool (entry (fst h) i) (start_at F i) && Qle_bool (start_at F i) (entry (snd h) i)) (seq 0 n) &&
  check_sides F (repeat 1%Q n) (fst h) (snd h) 0.
Definition chosen (n : nat) (p : nat -> bool) (l m : list Q) : list Q := map (fun i => if p i then entry l i else entry m i) (seq 0 n).
Definition check_box (F : family) (h : list Q * list Q) (b : box) : bool :=
  let n := order (frame F) in let p := fun i => mem i (whom b) && pos (entry (extent b) i) in
  forallb (fun i => (i <? n)%nat && (p i || Qeq_bool (entry (extent b) i) 0 && Qle_bool (entry (lower_end b) i) (entry (fst h) i) &&
    Qle_bool (entry (snd h) i) (entry (upper_end b) i))) (whom b) &&
  check_sides F (chosen n p (extent b) []) (chosen n p (lower_end b) (fst h)) (chosen n p (upper_end b) (snd h)) (speed b).
Definition check_boxes (F : family) (h : list Q * list Q) : bool := match boxes F with [] => true | l =>
  at_first F && check_hull F h && forallb (check_box F h) l end.

(** * What the rows say *)
Lemma entry_opp l i : Q2R (entry (map Qopp l) i) = - Q2R (entry l i).
Proof. unfold entry. rewrite <- Q2R_opp. f_equal. change 0%Q with (Qopp 0) at 1. apply map_nth. Qed.
Section Row.
Variables (n : nat) (d lo_ up : list Q) (x : nat -> R) (W : R).
Hypothesis HW : 0 <= W.
Hypothesis Hx : forall j, (j < n)%nat -> Q2R (entry lo_ j) - W * Q2R (entry d j) <= x j <= Q2R (entry up j) + W * Q2R (entry d j).
Lemma heard_inwards e w t s0 i : check_tie n e = true -> Q2R (bottom e) <= w <= Q2R (top e) -> (s0 < n)%nat ->
  x i = Q2R (entry up i) + W * Q2R (entry d i) ->
  (if (t =? i)%nat then Q2R (gap lo_ up e t s0) else 0) + W * (if (t =? i)%nat then Q2R (drawn d e t s0) else 0) <= heard t s0 w x i.
Proof.
  intros HT Hw Hs Hi. pose proof (size_between n e w HT Hw) as B. unfold heard. destruct (Nat.eqb_spec t i) as [->|]; [|lra].
  unfold gap, drawn. pose proof (worst_ok e (Rabs w) (entry d i - entry d s0)%Q B) as K1. rewrite Q2R_minus in K1.
  set (y := if positive e then entry up s0 else (- entry lo_ s0)%Q). pose proof (worst_ok e (Rabs w) (entry up i - y)%Q B) as K2. rewrite Q2R_minus in K2.
  apply (Rmult_le_compat_l W) in K1; [|exact HW]. specialize (Hx s0 Hs). rewrite Hi. pose proof (Rabs_pos w) as P.
  enough (w * x s0 <= Rabs w * (Q2R y + W * Q2R (entry d s0))) by lra.
  unfold check_tie in HT. apply andb_prop in HT as [HT _]. apply andb_prop in HT as [_ HT]. apply Qle_R in HT. rewrite Q2R_0 in HT.
  clear B K1 K2. unfold y. unfold lo in HT. destruct (positive e).
  - rewrite (Rabs_right w) by lra. apply Rmult_le_compat_l; lra.
  - rewrite Q2R_opp in HT. rewrite Q2R_opp. rewrite (Rabs_left1 w) by lra.
    replace (w * x s0) with (- w * - x s0) by ring. apply Rmult_le_compat_l; lra.
Qed.
Lemma row_inwards l : forallb (check_tie n) l = true -> forall w i, admits l w -> x i = Q2R (entry up i) + W * Q2R (entry d i) ->
  Q2R (row_sum l (gap lo_ up) i) + W * Q2R (row_sum l (drawn d) i) <= member l w x i.
Proof.
  intros HT w i Hw Ei. rewrite !row_sum_R. revert w Hw. induction l as [|e l IH]; intros w Hw; simpl; [lra|].
  simpl in HT. apply andb_prop in HT as [HT1 HT2]. specialize (IH HT2 (shift w) (fun j e0 E => Hw (S j) e0 E)).
  pose proof (Hw 0%nat e eq_refl) as W0. pose proof HT1 as HT1'. unfold check_tie in HT1'. apply andb_prop in HT1' as [HT1' _].
  apply andb_prop in HT1' as [HT1' _]. apply andb_prop in HT1' as [N1 N2]. apply Nat.ltb_lt in N1, N2.
  pose proof (heard_inwards e (w 0%nat) (head e) (tail e) i HT1 W0 N2 Ei) as K1.
  pose proof (heard_inwards e (w 0%nat) (tail e) (head e) i HT1 W0 N1 Ei) as K2. unfold pulls.
  set (A := fold_right _ 0 l) in *. set (B := fold_right _ 0 l) in IH |- *. destruct (mutual e); lra.
Qed.
End Row.

(** * Along a motion *)
Section Boxes.
Variable F : family.
Let c := frame F.
Let n := order c.
Let T := deadline c.
Let rho := Q2R (rho1 c).
Hypothesis Hframe : check_frame F = true.
Hypothesis Hmodes : forallb (check_mode F) (modes F) = true.
Theorem starts_quiet X Sl : at_first F = true -> starts F X Sl -> switches_from F X Sl 0.
Proof.
  intros H0 [HM HS]. split; [exact HM|]. destruct (positive_ F Hframe) as [P1 _]. split; [fold c in P1 |- *; lra|].
  intros t i Ht Hi. fold c in Ht, Hi. destruct (frame_parts F Hframe) as [A1 [A2 [A3 _]]]. fold c in A1, A2, A3.
  assert (Z : Sl 0 i = 0).
  { destruct (HS i Hi) as [_ E]. rewrite E. unfold at_first in H0. rewrite forallb_forall in H0. fold c in H0 |- *.
    destruct (Nat.lt_ge_cases i (length (sliding c))) as [L|L]; [|rewrite nth_overflow by exact L; apply Q2R_0].
    specialize (H0 _ (nth_In (sliding c) 0%Q L)). apply Qeq_R in H0. rewrite Q2R_0 in H0. exact H0. }
  destruct HM as [S1 [C _]]. fold c in S1, C. destruct (kind c) as [T0|T_r T_s mu1 mu2 mu3 delta] eqn:Ek.
  - unfold slides in S1. rewrite Ek in S1. apply S1.
  - pose proof (sliding_ok c A1 A2) as K. unfold sliding_claim in K. rewrite Ek in K.
    assert (Mv : moves c Sl Sl).
    { split; [|exact S1]. split.
      - intros u j Hu Hj. rewrite A3. apply (is_derive_ext (fun _ => 0)); [intros; symmetry; apply Rminus_diag_eq; reflexivity|].
        simpl. rewrite Rmult_0_r, Ropp_0. apply @is_derive_const.
      - intros u j Hu Hj. split; apply (C u j Hu Hj). }
    destruct (K Sl Sl Mv) as [[K1 K2] K3]. destruct (Rlt_dec t (Q2R T_r)) as [L|L]; [|apply K2; [lra|exact Hi]].
    destruct (K3 t i ltac:(lra) Hi) as [B _]. rewrite Z, Rabs_R0, Rmult_0_r in B. apply Rabs_le_between in B. lra.
Qed.
Section Sides.
Variables (d lo_ up : list Q) (r : Q).
Hypothesis HC : check_sides F d lo_ up r = true.
Let inside (a : R) (x : nat -> R) (i : nat) := Q2R (entry lo_ i) - a * Q2R (entry d i) <= x i <= Q2R (entry up i) + a * Q2R (entry d i).
Lemma side_ok l u i : check_side F d l u r = true -> (i < n)%nat -> Q2R (entry d i) = 0 \/ 0 < Q2R (entry d i) /\
  forall m, In m (modes F) -> 0 <= Q2R (row_sum (ties m) (gap l u) i) /\ Q2R r * Q2R (entry d i) <= 2 * Q2R (row_sum (ties m) (drawn d) i).
Proof.
  intros H Hi. unfold check_side in H. rewrite forallb_forall in H. specialize (H i ltac:(apply in_seq; unfold n, c in Hi; lia)).
  apply orb_prop in H as [H|H]; [left; apply Qeq_R in H; rewrite Q2R_0 in H; exact H|]. right. apply andb_prop in H as [A B]. apply Qpos in A.
  split; [exact A|]. intros m Hm. rewrite forallb_forall in B. specialize (B m Hm). apply andb_prop in B as [B1 B2]. apply Qle_R in B1, B2.
  rewrite Q2R_0 in B1. rewrite !Q2R_mult in B2. replace (Q2R 2) with 2 in B2 by (unfold Q2R; simpl; lra). split; assumption.
Qed.
Lemma extent_pos i : (i < n)%nat -> 0 <= Q2R (entry d i).
Proof. intros Hi. pose proof HC as H. unfold check_sides in H. apply andb_prop in H as [H _]. destruct (side_ok _ _ i H Hi) as [E|[E _]]; lra. Qed.
Variables (X Sl : R -> nat -> R).
Hypothesis HM : switches_from F X Sl 0.
Hypothesis Hkept : forall t i, 0 <= t < T -> (i < n)%nat -> Q2R (entry d i) = 0 -> Q2R (entry lo_ i) <= X t i <= Q2R (entry up i).
Theorem drawn_in a : 0 <= a -> (forall i, (i < n)%nat -> inside a (X 0) i) -> forall t i, 0 <= t < T -> (i < n)%nat ->
  inside (exp (- (Q2R r / 2 * s c t)) * a) (X t) i.
Proof.
  intros Ha H0 t1 i1 Ht1 Hi1. set (rr := Q2R r) in *. destruct (positive_ F Hframe) as [P1 [P2 P3]]. fold c in P1, P2, P3. fold T rho in P1, P2.
  pose proof HC as H. unfold check_sides in H. apply andb_prop in H as [HU HL].
  set (Y := fun u => X (Rmax 0 u)). set (e := fun u => exp (rr / 2 * s c u)).
  assert (Pe : forall u, 0 < e u) by (intros; apply exp_pos).
  assert (Ee : forall u, u < T -> is_derive e u (rr / 2 * gain T rho (k c) u * e u)).
  { intros u Hu. unfold e. evar_last. { apply is_derive_comp; [apply is_derive_exp|]. apply is_derive_scal. apply (clock_derive T rho (k c) P1 u Hu). }
    unfold scal; simpl; unfold mult; simpl. change (clock T rho (k c) u) with (s c u). ring. }
  (* 2 n + 1 functions: how far each agent is above and below, in extents, and 0 *)
  set (sg := fun j : nat => if (j <? n)%nat then 1 else -1). set (ix := fun j => if (j <? n)%nat then j else (j - n)%nat).
  set (en := fun j => if (j <? n)%nat then Q2R (entry up (ix j)) else - Q2R (entry lo_ (ix j))).
  set (q := fun j => if Req_EM_T (Q2R (entry d (ix j))) 0 then 0 else if (j <? n + n)%nat then / Q2R (entry d (ix j)) else 0).
  set (f := fun j u => q j * (e u * (sg j * Y u (ix j) - en j))).
  destruct (Y_moves F X Sl 0 HM) as [D HD]. fold c in HD. fold T rho n in HD. fold Y in HD.
  assert (Hq : forall j, (j < n + n + 1)%nat -> 0 <= q j).
  { intros j Hj. unfold q. destruct (Req_EM_T _ 0) as [|N]; [lra|]. destruct (Nat.ltb_spec j (n + n)); [|lra].
    left. apply Rinv_0_lt_compat. assert (Hi : (ix j < n)%nat) by (unfold ix; destruct (Nat.ltb_spec j n); lia). pose proof (extent_pos _ Hi). lra. }
  assert (G : forall j u, 0 <= u < T -> (j < n + n + 1)%nat -> f j u <= e 0 * a).
  { intros j u Hu Hj. apply (never_grows (n + n + 1) f 0 T D); [| | |exact Hu|exact Hj]; clear j u Hu Hj.
    - intros j u Hj Hu. unfold f. destruct (Req_EM_T (q j) 0) as [Z|Nz].
      { rewrite Z. apply (continuous_ext (fun _ => 0)); [intros; simpl; ring|apply continuous_const]. }
      assert (Hi : (ix j < n)%nat). { unfold q in Nz. destruct (Req_EM_T _ 0); [lra|]. destruct (Nat.ltb_spec j (n + n)); [|lra]. unfold ix. destruct (Nat.ltb_spec j n); lia. }
      apply (continuous_mult (fun _ => q j)); [apply continuous_const|]. apply (continuous_mult e (fun u => sg j * Y u (ix j) - en j)).
      + apply @ex_derive_continuous. eexists. apply Ee. lra.
      + apply (continuous_minus (fun u => sg j * Y u (ix j)) (fun _ => en j)); [|apply continuous_const].
        apply (continuous_mult (fun _ => sg j)); [apply continuous_const|]. apply (Y_cont F X Sl 0 HM u _ Hu Hi).
    - intros u Hu Hj j Hjn. destruct (HD u Hu Hj) as [m [w [Hm [Hw E]]]]. set (L := member (ties m) w (Y u)) in *. set (g := gain T rho (k c) u) in *.
      pose proof (gain_pos T rho (k c) P2 P3 u ltac:(lra)) as Gp. fold g in Gp. pose proof (Pe u) as Pu.
      destruct (Req_EM_T (q j) 0) as [Z|Nz].
      { exists 0. split; [|intros; lra]. unfold f. rewrite Z. apply (is_derive_ext (fun _ => 0)); [intros; simpl; ring|apply (is_derive_const 0)]. }
      assert (J : (j < n + n)%nat /\ Q2R (entry d (ix j)) <> 0 /\ q j = / Q2R (entry d (ix j))).
      { unfold q in Nz |- *. destruct (Req_EM_T _ 0); [lra|]. destruct (Nat.ltb_spec j (n + n)); [|lra]. auto. }
      destruct J as [J [Nd Eq]]. set (i := ix j) in *. assert (Hi : (i < n)%nat) by (unfold i, ix; destruct (Nat.ltb_spec j n); lia).
      set (di := Q2R (entry d i)) in *. assert (Dp : 0 < di) by (pose proof (extent_pos i Hi) as K; fold di in K; lra).
      exists (q j * (rr / 2 * g * e u * (sg j * Y u i - en j) + e u * (sg j * - (g * L i)))). split.
      + unfold f. fold i. apply is_derive_scal. apply (is_derive_mult e (fun u => sg j * Y u i - en j) u); [apply Ee; lra| |intros; apply Rmult_comm].
        evar_last. { apply (is_derive_minus (fun u => sg j * Y u i) (fun _ => en j)); [|apply is_derive_const]. apply is_derive_scal. apply E. exact Hi. }
        unfold minus, plus, opp, zero; simpl. unfold L, Y. lra.
      + intros Mx. set (W := (sg j * Y u i - en j) / di). assert (Fj : f j u = e u * W) by (unfold f, W; fold i; rewrite Eq; unfold Rdiv; ring).
        assert (W0 : 0 <= W).
        { pose proof (Mx (n + n)%nat ltac:(lia)) as M0. rewrite Fj in M0. unfold f at 1 in M0.
          assert (Z : q (n + n)%nat = 0) by (unfold q; destruct (Req_EM_T _ 0); [reflexivity|]; destruct (Nat.ltb_spec (n + n) (n + n)); [lia|reflexivity]).
          rewrite Z, Rmult_0_l in M0. apply (Rmult_le_reg_l (e u)); [exact Pu|]. lra. }
        assert (All : forall v, (v < n)%nat -> Q2R (entry lo_ v) - W * Q2R (entry d v) <= Y u v <= Q2R (entry up v) + W * Q2R (entry d v)).
        { intros v Hv. destruct (Req_EM_T (Q2R (entry d v)) 0) as [Z|Nv].
          - pose proof (Hkept u v ltac:(lra) Hv Z) as K. unfold Y. rewrite Rmax_right by lra. rewrite Z, !Rmult_0_r. lra.
          - pose proof (extent_pos v Hv) as Dv. set (dv := Q2R (entry d v)) in *.
            pose proof (Mx v ltac:(lia)) as M1. pose proof (Mx (v + n)%nat ltac:(lia)) as M2. rewrite Fj in M1, M2. unfold f, q, sg, en, ix in M1, M2.
            destruct (Nat.ltb_spec v n); [|lia]. destruct (Nat.ltb_spec (v + n) n); [lia|]. replace (v + n - n)%nat with v in M2 by lia.
            fold dv in M1, M2. destruct (Req_EM_T dv 0); [lra|]. destruct (Nat.ltb_spec v (n + n)); [|lia]. destruct (Nat.ltb_spec (v + n) (n + n)); [|lia].
            assert (B1 : / dv * (Y u v - Q2R (entry up v)) <= W) by (apply (Rmult_le_reg_l (e u)); [exact Pu|]; lra).
            assert (B2 : / dv * (Q2R (entry lo_ v) - Y u v) <= W) by (apply (Rmult_le_reg_l (e u)); [exact Pu|]; lra).
            apply (Rmult_le_compat_r dv) in B1; [|lra]. apply (Rmult_le_compat_r dv) in B2; [|lra].
            replace (/ dv * (Y u v - Q2R (entry up v)) * dv) with (Y u v - Q2R (entry up v)) in B1 by (field; lra).
            replace (/ dv * (Q2R (entry lo_ v) - Y u v) * dv) with (Q2R (entry lo_ v) - Y u v) in B2 by (field; lra). lra. }
        assert (K : rr / 2 * (W * di) <= sg j * L i).
        { unfold W, sg, en in *. destruct (Nat.ltb_spec j n) as [Lj|Lj].
          - destruct (side_ok _ _ i HU Hi) as [Z|[_ R]]; [unfold di in Nd; contradiction|]. destruct (R m Hm) as [R1 R2]. fold di rr in R2. fold i in W0, All |- *.
            set (V := (1 * Y u i - Q2R (entry up i)) / di) in *.
            pose proof (row_inwards n d lo_ up (Y u) V W0 All (ties m) (ties_ok F Hmodes m Hm) w i Hw ltac:(unfold V; fold di; field; lra)) as K.
            fold L in K. apply (Rmult_le_compat_l V) in R2; [|exact W0]. lra.
          - destruct (side_ok _ _ i HL Hi) as [Z|[_ R]]; [unfold di in Nd; contradiction|]. destruct (R m Hm) as [R1 R2]. fold di rr in R2. fold i in W0, All |- *.
            set (V := (-1 * Y u i - - Q2R (entry lo_ i)) / di) in *.
            pose proof (row_inwards n d (map Qopp up) (map Qopp lo_) (fun v => -1 * Y u v) V W0) as K.
            specialize (K ltac:(intros v Hv; specialize (All v Hv); rewrite !entry_opp; lra) (ties m) (ties_ok F Hmodes m Hm) w i Hw).
            specialize (K ltac:(rewrite entry_opp; unfold V; fold di; field; lra)). rewrite (member_scal (ties m) w (-1) (Y u)) in K.
            fold L in K. apply (Rmult_le_compat_l V) in R2; [|exact W0]. lra. }
        assert (Ei : sg j * Y u i - en j = W * di) by (unfold W; field; lra). rewrite Ei.
        replace (q j * (rr / 2 * g * e u * (W * di) + e u * (sg j * - (g * L i)))) with (q j * (g * e u) * (rr / 2 * (W * di) - sg j * L i)) by ring.
        assert (0 <= q j * (g * e u)) by (apply Rmult_le_pos; [apply Hq; exact Hjn|apply Rmult_le_pos; lra]). nra.
    - intros j Hj. unfold f. pose proof (Pe 0) as Pu. unfold q. destruct (Req_EM_T _ 0) as [Z|Nz].
      { rewrite Rmult_0_l. apply Rmult_le_pos; lra. }
      destruct (Nat.ltb_spec j (n + n)) as [J|J]; [|rewrite Rmult_0_l; apply Rmult_le_pos; lra].
      set (i := ix j) in *. assert (Hi : (i < n)%nat) by (unfold i, ix; destruct (Nat.ltb_spec j n); lia).
      pose proof (extent_pos i Hi) as Dp. specialize (H0 i Hi). unfold inside in H0. set (di := Q2R (entry d i)) in *. unfold Y. rewrite Rmax_left by lra.
      assert (B : sg j * X 0 i - en j <= a * di) by (unfold sg, en; fold i; destruct (j <? n)%nat; lra).
      replace (/ di * (e 0 * (sg j * X 0 i - en j))) with (e 0 * ((sg j * X 0 i - en j) / di)) by (unfold Rdiv; ring).
      apply Rmult_le_compat_l; [lra|]. apply (Rmult_le_reg_r di); [lra|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by exact Nz. lra. }
  assert (E0 : e 0 = 1) by (unfold e; replace (s c 0) with 0; [rewrite Rmult_0_r; apply exp_0|symmetry; apply (clock_0 T rho (k c) P1)]).
  rewrite E0, Rmult_1_l in G. pose proof (Pe t1) as Pb.
  assert (Ei : exp (- (rr / 2 * s c t1)) = / e t1) by (unfold e; apply exp_Ropp). unfold inside. rewrite Ei.
  destruct (Req_EM_T (Q2R (entry d i1)) 0) as [Z|Nz]; [rewrite Z, !Rmult_0_r; pose proof (Hkept t1 i1 Ht1 Hi1 Z); lra|].
  pose proof (extent_pos i1 Hi1) as Dp. pose proof (G i1 t1 Ht1 ltac:(lia)) as G1. pose proof (G (i1 + n)%nat t1 Ht1 ltac:(lia)) as G2.
  unfold f, q, sg, en, ix in G1, G2.
  destruct (Nat.ltb_spec i1 n); [|lia]. destruct (Nat.ltb_spec (i1 + n) n); [lia|]. replace (i1 + n - n)%nat with i1 in G2 by lia.
  set (di := Q2R (entry d i1)) in *. destruct (Req_EM_T di 0); [lra|]. destruct (Nat.ltb_spec i1 (n + n)); [|lia]. destruct (Nat.ltb_spec (i1 + n) (n + n)); [|lia].
  unfold Y in G1, G2. rewrite Rmax_right in G1, G2 by lra.
  assert (Pd : 0 <= / e t1 * di) by (apply Rmult_le_pos; [left; apply Rinv_0_lt_compat; exact Pb|lra]).
  apply (Rmult_le_compat_r (/ e t1 * di)) in G1, G2; [|exact Pd|exact Pd].
  replace (/ di * (e t1 * (1 * X t1 i1 - Q2R (entry up i1))) * (/ e t1 * di)) with (X t1 i1 - Q2R (entry up i1)) in G1 by (field; lra).
  replace (/ di * (e t1 * (-1 * X t1 i1 - - Q2R (entry lo_ i1))) * (/ e t1 * di)) with (Q2R (entry lo_ i1) - X t1 i1) in G2 by (field; lra).
  lra.
Qed.
End Sides.

Theorem hull_ok h X Sl : at_first F = true -> check_hull F h = true -> starts F X Sl -> forall t i, 0 <= t < T -> (i < n)%nat ->
  Q2R (entry (fst h) i) <= X t i <= Q2R (entry (snd h) i).
Proof.
  intros A H HS t i Ht Hi. unfold check_hull in H. cbv zeta in H. fold c n in H. apply andb_prop in H as [H1 H2]. rewrite forallb_forall in H1.
  assert (E1 : forall j, (j < n)%nat -> entry (repeat 1%Q n) j = 1%Q).
  { clear. induction n as [|m IH]; intros [|j] Hj; try lia; [reflexivity|]. apply IH. lia. }
  assert (R1 : Q2R 1 = 1) by (unfold Q2R; simpl; lra).
  pose proof (drawn_in _ _ _ _ H2 X Sl (starts_quiet X Sl A HS)
    ltac:(intros u j _ Hj Z; rewrite E1 in Z by exact Hj; lra) 0 (Rle_refl 0)) as K.
  cbv beta in K. rewrite <- (Rminus_0_r (Q2R (entry (fst h) i))). rewrite <- (Rplus_0_r (Q2R (entry (snd h) i))).
  specialize (K ltac:(intros j Hj; rewrite !Rmult_0_l, Rminus_0_r, Rplus_0_r; specialize (H1 j ltac:(apply in_seq; lia)); apply andb_prop in H1 as [B1 B2];
    apply Qle_R in B1, B2; destruct HS as [_ HS]; destruct (HS j Hj) as [HS1 _]; rewrite HS1; split; assumption) t i Ht Hi).
  rewrite Rmult_0_r, Rmult_0_l in K. exact K.
Qed.
Lemma chosen_R p l m i : (i < n)%nat -> entry (chosen n p l m) i = if p i then entry l i else entry m i.
Proof. intros Hi. unfold chosen, entry at 1. rewrite (nth_map_seq _ n i) by exact Hi. reflexivity. Qed.
Theorem boxes_ok h : check_boxes F h = true -> forall b, In b (boxes F) -> box_claim F b.
Proof.
  intros H b Hb. assert (K : at_first F && check_hull F h && forallb (check_box F h) (boxes F) = true).
  { unfold check_boxes in H. destruct (boxes F); [destruct Hb|exact H]. }
  clear H. apply andb_prop in K as [K K3]. apply andb_prop in K as [K1 K2]. rewrite forallb_forall in K3. specialize (K3 b Hb).
  unfold check_box in K3. cbv zeta in K3. fold c n in K3. set (p := fun i => mem i (whom b) && pos (entry (extent b) i)) in *.
  apply andb_prop in K3 as [K3 K4]. rewrite forallb_forall in K3. intros X S t a at_ at_most HS Ht Ha H0 i Hi.
  assert (N : forall j, In j (whom b) -> (j < n)%nat) by (intros j Hj; specialize (K3 j Hj); apply andb_prop in K3 as [A _]; apply Nat.ltb_lt; exact A).
  assert (E0 : forall j, Q2R (entry [] j) = 0) by (intros [|j]; apply Q2R_0).
  pose proof (hull_ok h X S K1 K2 HS) as HH. fold c in Ht. fold T in Ht. destruct (positive_ F Hframe) as [P1 _]. fold c in P1. fold T in P1.
  pose proof (drawn_in _ _ _ _ K4 X S (starts_quiet X S K1 HS)) as G. cbv zeta in G.
  assert (G1 : forall u j, 0 <= u < T -> (j < n)%nat -> Q2R (entry (chosen n p (extent b) []) j) = 0 ->
    Q2R (entry (chosen n p (lower_end b) (fst h)) j) <= X u j <= Q2R (entry (chosen n p (upper_end b) (snd h)) j)).
  { intros u j Hu Hj Z. rewrite chosen_R in Z by exact Hj. rewrite (chosen_R p (lower_end b)), (chosen_R p (upper_end b)) by exact Hj. destruct (p j) eqn:Ep; [|apply HH; assumption].
    unfold p in Ep. apply andb_prop in Ep as [_ Ep]. apply Qpos in Ep. lra. }
  specialize (G G1 a Ha).
  assert (G2 : forall j, (j < n)%nat -> Q2R (entry (chosen n p (lower_end b) (fst h)) j) - a * Q2R (entry (chosen n p (extent b) []) j) <= X 0 j <=
    Q2R (entry (chosen n p (upper_end b) (snd h)) j) + a * Q2R (entry (chosen n p (extent b) []) j)).
  { intros j Hj. rewrite (chosen_R p (lower_end b)), (chosen_R p (upper_end b)), (chosen_R p (extent b)) by exact Hj. destruct (p j) eqn:Ep.
    - unfold p in Ep. apply andb_prop in Ep as [E1 E2]. apply mem_In in E1. apply Qpos in E2. apply (H0 j E1 E2).
    - rewrite E0, Rmult_0_r. pose proof (HH 0 j ltac:(lra) Hj). lra. }
  specialize (G G2 t i Ht (N i Hi)). cbv beta in G. rewrite (chosen_R p (lower_end b)), (chosen_R p (upper_end b)), (chosen_R p (extent b)) in G by (apply N; exact Hi). unfold at_most, at_. specialize (K3 i Hi).
  apply andb_prop in K3 as [_ K3]. fold c. fold (entry (extent b) i) (entry (lower_end b) i) (entry (upper_end b) i). cbv zeta. destruct (p i) eqn:Ep; [exact G|].
  change (p i || Qeq_bool (entry (extent b) i) 0 && Qle_bool (entry (lower_end b) i) (entry (fst h) i) && Qle_bool (entry (snd h) i) (entry (upper_end b) i) = true) in K3.
  rewrite Ep in K3. simpl in K3. apply andb_prop in K3 as [K3 B2]. apply andb_prop in K3 as [B0 B1]. apply Qeq_R in B0. apply Qle_R in B1, B2. rewrite Q2R_0 in B0.
  rewrite E0, Rmult_0_r in G. rewrite B0, Rmult_0_r. lra.
Qed.
End Boxes.
