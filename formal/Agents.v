(** The theorem of agents of order n: what the check accepts is true. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz FunctionalExtensionality.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Slide Main Mean Peak Weighted Large AgentCertificate AgentForms AgentCheck AgentFall AgentMotion AgentExist AgentEnd AgentRest AgentDrag.
Open Scope R_scope.

(** * Rationals and polynomials of the check *)
Lemma peval_reduced p x : peval (map reduced p) x = peval p x.
Proof. induction p as [|q p IH]; simpl; [reflexivity|]. rewrite reduced_ok, IH. reflexivity. Qed.
Lemma hom_reduced p x z : hom (map reduced p) x z = hom p x z.
Proof. induction p as [|q p IH]; simpl; [reflexivity|]. rewrite reduced_ok, IH, map_length. reflexivity. Qed.
Lemma peval_shifted m q x : peval (repeat 0%Q m ++ [q]) x = x ^ m * Q2R q.
Proof. induction m as [|m IH]; simpl; [ring|]. rewrite IH, Q2R_0. ring. Qed.
Lemma peval_choose b p x : peval (choose b p) x = if b then peval p x else 0.
Proof. destruct b; reflexivity. Qed.
Lemma table_ok n g i j : (i < n)%nat -> (j < n)%nat -> look (table n g) i j = g i j.
Proof. intros Hi Hj. unfold look, table. rewrite nth_map_seq by exact Hi. apply nth_map_seq. exact Hj. Qed.
Lemma table_row n g i : (i < n)%nat -> length (nth i (table n g) []) = n.
Proof. intros Hi. unfold table. rewrite nth_map_seq by exact Hi. rewrite map_length, seq_length. reflexivity. Qed.

Section Agents.
Variables (h : hints) (split : splitting) (points : list Q) (a : agents).
Let c := graph a.
Let n := degree a.
Let T := deadline c.
Let d := prepare c.
Let es := edges c.
Let rho := Q2R (slope a).

Lemma chain_ok g i l z : Q2R (pull_in a) <> 0 ->
  peval (chain a g i l) z = entry_at a z (if g then sq (1 - rho * z) / Q2R (pull_in a) else 0) i l.
Proof.
  intros Hk. unfold chain, entry_at. rewrite !peval_padd, !peval_choose, peval_pscale, peval_padd, peval_shifted.
  assert (K : ~ (pull_in a == 0)%Q) by (intros E; apply Hk; rewrite (Qeq_eqR _ _ E); apply Q2R_0).
  simpl peval. rewrite Q2R_opp, Q2R_div, index_ok by exact K. rewrite !Q2R_opp, !Q2R_mult, Q2R_1.
  assert (Q2 : Q2R 2 = 2) by (unfold Q2R; simpl; field). rewrite Q2. fold rho. unfold at_, sq.
  destruct g, (S i =? l)%nat, (i =? l)%nat, (S i =? degree a)%nat; cbn [andb]; field; exact Hk.
Qed.
Lemma fall_ok A z i j : peval (fall_entry a A i j) z
  = (if (S i =? n)%nat && (S j =? n)%nat then 1 else 0) - Q2R (falls a) * at_ (nth i (W a) []) j
    - sum n (fun l => peval (A i l) z * at_ (nth l (W a) []) j + peval (A j l) z * at_ (nth i (W a) []) l).
Proof.
  unfold fall_entry. fold n. rewrite peval_padd, peval_pscale.
  assert (E : forall s, peval (fold_right (fun l p => padd (padd (pscale (cell (W a) l j) (A i l)) (pscale (cell (W a) i l) (A j l))) p) [] s) z
    = fold_right (fun l b => peval (A i l) z * at_ (nth l (W a) []) j + peval (A j l) z * at_ (nth i (W a) []) l + b) 0 s).
  { induction s as [|l s IH]; cbn [fold_right]; [reflexivity|]. rewrite !peval_padd, !peval_pscale, IH. unfold cell, at_. ring. }
  rewrite E. unfold sum. set (q := fold_right _ 0 (seq 0 n)). cbn [peval]. rewrite Q2R_minus, Q2R_mult. unfold cell.
  change (Q2R (nth j (nth i (W a) []) 0%Q)) with (at_ (nth i (W a) []) j).
  assert (M : Q2R (-1) = -1) by (unfold Q2R; simpl; field). rewrite M.
  destruct ((S i =? n)%nat && (S j =? n)%nat); rewrite ?Q2R_1, ?Q2R_0; ring.
Qed.
(** the table is nonnegative beside every form where a polynomial of it is taken at [zeta] between two points *)
Let m := Nat.max n 2.
Lemma interval_ok tab low high z F Y : positive F -> check_interval split n m tab low high = true ->
  forallb (forallb (fun p : list Q => (length p <=? S m)%nat)) tab = true -> length tab = n -> (forall i, (i < n)%nat -> length (nth i tab []) = n) ->
  Q2R low <= z <= Q2R high -> 0 <= sum n (fun i => sum n (fun j => peval (look tab i j) z * F (Y i) (Y j))).
Proof.
  intros HF H HL L1 L2 Hz. unfold check_interval in H. cbv zeta in H.
  set (x := if Req_EM_T (Q2R low) (Q2R high) then 0 else (z - Q2R low) / (Q2R high - Q2R low)).
  assert (Hx : 0 <= x <= 1 /\ Q2R low + Q2R (high - low) * x = z).
  { unfold x. rewrite Q2R_minus. destruct (Req_EM_T (Q2R low) (Q2R high)) as [E|E]; [split; [lra|]; rewrite Rmult_0_r; lra|].
    split; [|field; lra]. split.
    - apply Rmult_le_pos; [lra|]. left. apply Rinv_0_lt_compat. lra.
    - apply (Rmult_le_reg_r (Q2R high - Q2R low)); [lra|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. lra. }
  destruct Hx as [X1 X2]. set (B := fun i j => map reduced (bernstein m (moved low (high - low) (look tab i j)))).
  assert (LB : forall i j, length (B i j) = S m) by (intros; unfold B; rewrite map_length; apply bernstein_length).
  assert (Elook : forall i j, (i < n)%nat -> (j < n)%nat -> peval (look tab i j) z = sum (S m) (fun u => at_ (B i j) u * (x ^ u * (1 - x) ^ (m - u)))).
  { intros i j Hi Hj. rewrite <- X2, <- moved_ok, <- (bernstein_ok m).
    - rewrite <- hom_reduced. fold (B i j). rewrite hom_sum, LB. reflexivity.
    - assert (Lm : forall p, (length (moved low (high - low) p) <= length p)%nat).
      { clear. assert (Lp : forall p q, (length (padd p q) = Nat.max (length p) (length q))%nat)
          by (induction p as [|u p IH]; intros [|v q]; simpl; auto).
        induction p as [|u p IH]; [simpl; lia|]. cbn [moved]. cbv zeta. rewrite !Lp. unfold pscale. cbn [length]. rewrite !map_length. lia. }
      eapply Nat.le_trans; [apply Lm|]. rewrite forallb_forall in HL. specialize (HL (nth i tab [])). rewrite forallb_forall in HL.
      apply Nat.leb_le. apply HL; [apply nth_In; lia|]. apply nth_In. rewrite L2 by exact Hi. exact Hj. }
  rewrite (sum_ext n _ (fun i => sum (S m) (fun u => (x ^ u * (1 - x) ^ (m - u)) * sum n (fun j => at_ (B i j) u * F (Y i) (Y j))))).
  2: { intros i Hi. rewrite (sum_ext n _ (fun j => sum (S m) (fun u => (x ^ u * (1 - x) ^ (m - u)) * (at_ (B i j) u * F (Y i) (Y j))))).
    - rewrite sum_swap. apply sum_ext. intros u _. apply sum_scal.
    - intros j Hj. rewrite Elook by assumption. rewrite Rmult_comm, <- sum_scal. apply sum_ext. intros. ring. }
  rewrite sum_swap. rewrite <- (sum_zero (S m) (fun _ => 0)) by reflexivity. apply sum_le. intros u Hu. rewrite sum_scal.
  apply Rmult_le_pos; [apply Rmult_le_pos; apply pow_le; lra|].
  rewrite forallb_forall in H. specialize (H u ltac:(apply in_seq; lia)). pose proof (psd_ok _ _ _ F Y HF H) as K. unfold double in K.
  eapply Rle_trans; [exact K|]. apply Req_le. apply sum_ext. intros i Hi. apply sum_ext. intros j Hj. f_equal. unfold at_. f_equal.
  set (g := fun p => map reduced (bernstein m (moved low (high - low) p))). fold g.
  rewrite nth_indep with (d' := map (fun p => nth u p 0%Q) (map g [])) by (rewrite !map_length; lia).
  rewrite (map_nth (map (fun p => nth u p 0%Q))), (map_nth (map g)).
  rewrite nth_indep with (d' := (fun p => nth u p 0%Q) (g [])) by (rewrite !map_length, L2; lia).
  rewrite (map_nth (fun p => nth u p 0%Q)), (map_nth g). reflexivity.
Qed.
Lemma points_ok check last z : forall points low, check_points check low points last = true -> Q2R low <= z <= Q2R last ->
  points <> [] -> exists low high, check low high = true /\ Q2R low <= z <= Q2R high.
Proof.
  induction points0 as [|p l IH]; intros low H Hz Hp; [contradiction|]. simpl in H. apply andb_prop in H as [H1 H2].
  destruct (Rle_lt_dec z (Q2R p)) as [L|L]; [exists low, p; split; [exact H1|lra]|].
  destruct l as [|q l]; [|apply (IH p); [exact H2|lra|discriminate]].
  simpl in H2. apply Qeq_bool_eq, Qeq_eqR in H2. lra.
Qed.
End Agents.

Definition check_agents_only (split : splitting) (points : list Q) (a : agents) : bool :=
  check_matrices split a && check_decrease split a points && check_coupling a && check_agree a && check_common a && check_ends_of a && check_tops a && check_left a.
Definition accepts_agents (h : hints) (split : splitting) (points : list Q) (a : agents) : bool :=
  accepts h (graph a) && negb (enclosed (graph a)) && check_agents_only split points a.

Section Sound.
Variables (h : hints) (split : splitting) (points : list Q) (a : agents).
Let c := graph a.
Let n := degree a.
Let d := prepare c.
Hypothesis Hedges : check_edges c (dls d) = true.
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hend : check_end c d = true.
Hypothesis Hfuncs : forallb (check_function c d) (funcs c) = true.
Hypothesis Hmatrices : check_matrices split a = true.
Hypothesis Hdecrease : check_decrease split a points = true.
Hypothesis Hcoupling : check_coupling a = true.

Lemma pull_ok : Q2R (pull_in a) = k c.
Proof. unfold pull_in, k. rewrite Q2R_mult. reflexivity. Qed.
Lemma matrices : psd split n (W a) = true /\ 0 < Q2R (coupling a) /\ 0 < Q2R (falls a) /\ positive_gain a /\ (0 < n)%nat /\
  (forall i j, (i < n)%nat -> (j < n)%nat -> at_ (nth i (P a) []) j = at_ (nth j (P a) []) i) /\
  (forall i j, (i < n)%nat -> (j < n)%nat -> sum n (fun l => at_ (nth i (W a) []) l * at_ (nth l (P a) []) j) = if (i =? j)%nat then 1 else 0) /\
  forall i, (i < n)%nat -> sum n (fun l => at_ (nth i (W a) []) l * at_ (gains a) l) = if (S i =? n)%nat then Q2R (coupling a) else 0.
Proof.
  unfold check_matrices in Hmatrices. fold n in Hmatrices. cbv zeta in Hmatrices.
  apply andb_prop in Hmatrices as [H H6]. apply andb_prop in H as [H H5]. apply andb_prop in H as [H H4].
  apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2]. simpl in H2. apply andb_prop in H2 as [P1 P2].
  apply andb_prop in P2 as [P2 _]. split; [exact H1|]. split; [apply Qpos; exact P1|]. split; [apply Qpos; exact P2|].
  split; [apply andb_prop in H3 as [H3 HG]; split; [apply notneg_ok; exact H3|intros G EG; rewrite EG in HG; apply Qpos; exact HG]|].
  split; [apply Nat.ltb_lt; exact H4|]. split; [|split].
  - intros i j Hi Hj. pose proof (square_ok _ _ H5 i j Hi Hj) as K. cbv beta in K. apply andb_prop in K as [K _].
    apply Qeq_bool_eq, Qeq_eqR in K. exact K.
  - intros i j Hi Hj. pose proof (square_ok _ _ H5 i j Hi Hj) as K. cbv beta in K. apply andb_prop in K as [_ K].
    apply Qeq_bool_eq, Qeq_eqR in K. unfold row_times in K. rewrite qsum_ok in K.
    rewrite (sum_ext n _ (fun l => Q2R (cell (W a) i l * cell (P a) l j))) by (intros; rewrite Q2R_mult; reflexivity).
    rewrite K. destruct (i =? j)%nat; [apply Q2R_1|apply Q2R_0].
  - intros i Hi. rewrite forallb_forall in H6. specialize (H6 i ltac:(apply in_seq; lia)). apply Qeq_bool_eq, Qeq_eqR in H6.
    unfold row_times in H6. rewrite qsum_ok in H6.
    rewrite (sum_ext n _ (fun l => Q2R (cell (W a) i l * nth l (gains a) 0%Q))) by (intros; rewrite Q2R_mult; reflexivity).
    rewrite H6. destruct (S i =? n)%nat; [reflexivity|apply Q2R_0].
Qed.
Lemma definite_ok : definite a.
Proof.
  destruct matrices as [M1 [_ [_ [_ [_ [_ [M7 M8]]]]]]]. split.
  - intros x. assert (PF : positive (fun u v : nat -> R => u O * v O)).
    { constructor; intros; try ring. apply Rle_0_sqr. }
    apply (psd_ok split n (W a) _ (fun i _ => x i) PF M1).
  - intros i Hi. split; [apply M8; exact Hi|]. intros j Hj. apply M7; assumption.
Qed.
Lemma index_2 m : Q2R (2 * index m) = 2 * INR m.
Proof. rewrite Q2R_mult, index_ok. f_equal. unfold Q2R. simpl. field. Qed.
Lemma gain_slope t : 0 <= t < deadline c -> 0 < eta a t /\ eta a 0 <= eta a t.
Proof.
  intros Ht. destruct matrices as [_ [_ [_ [M4 _]]]]. split; [apply (eta_pos a Hprot M4); apply Ht|apply (eta_grows a Hprot); exact Ht].
Qed.
Lemma span_pos : ~ (span (graph a) == 0)%Q.
Proof.
  intros E. destruct (T_k a Hprot) as [A _]. apply Qeq_eqR in E. rewrite Q2R_0 in E. pose proof (span_ok c) as SO. unfold c in *. lra.
Qed.
Lemma begin_ok : Q2R (begin_gain a) = uncapped a 0.
Proof.
  unfold begin_gain. rewrite Q2R_plus, Q2R_div, pull_ok by exact span_pos. fold c. rewrite span_ok.
  unfold uncapped, gain. fold c. rewrite Rminus_0_r. reflexivity.
Qed.
Lemma first_ok : Q2R (first_gain a) = eta a 0.
Proof.
  unfold first_gain, eta. change (gain (deadline (graph a)) (Q2R (slope a)) (k (graph a)) 0) with (uncapped a 0). rewrite <- begin_ok.
  destruct (cap a) as [G|]; [|reflexivity]. unfold lesser. destruct (Qle_bool (begin_gain a) G) eqn:E.
  - apply Qle_bool_iff, Qle_Rle in E. rewrite Rmin_left by exact E. reflexivity.
  - destruct (Qlt_le_dec G (begin_gain a)) as [L|L]; [|apply Qle_bool_iff in L; congruence].
    apply Qlt_Rlt in L. rewrite Rmin_right by lra. reflexivity.
Qed.
Lemma inverse_ok q : 0 < Q2R q -> Q2R (/ q) = / Q2R q.
Proof. intros H. apply Q2R_inv. intros E. apply Qeq_eqR in E. rewrite E, Q2R_0 in H. lra. Qed.
Lemma peval_at p q : Q2R (evaluate p q) = peval p (Q2R q).
Proof. induction p as [|b p IH]; cbn [evaluate peval]; [apply Q2R_0|]. rewrite Q2R_plus, Q2R_mult, IH. reflexivity. Qed.
(** the matrix of the decrease, at every instant *)
Lemma entries_ok g z F (Y : nat -> nat -> R) :
  sum n (fun i => sum n (fun j => peval (look (fall_table a g) i j) z * F (Y i) (Y j))) =
  sum n (fun i => sum n (fun j => ((if (S i =? n)%nat && (S j =? n)%nat then 1 else 0) - Q2R (falls a) * at_ (nth i (W a) []) j
    - sum n (fun l => entry_at a z (if g then sq (1 - Q2R (slope a) * z) / k c else 0) i l * at_ (nth l (W a) []) j
      + entry_at a z (if g then sq (1 - Q2R (slope a) * z) / k c else 0) j l * at_ (nth i (W a) []) l)) * F (Y i) (Y j))).
Proof.
  destruct (T_k a Hprot) as [A B]. fold c in A, B. apply sum_ext. intros i Hi. apply sum_ext. intros j Hj. f_equal.
  unfold fall_table. cbv zeta. rewrite table_ok by assumption. rewrite peval_reduced, fall_ok. f_equal.
  apply sum_ext. intros l' Hl. rewrite !table_ok by assumption.
  assert (Nk : Q2R (pull_in a) <> 0) by (rewrite pull_ok; lra). rewrite !chain_ok by exact Nk. rewrite pull_ok. reflexivity.
Qed.
Lemma falls_ok F Y t : positive F -> 0 < t < deadline c -> let z := / eta a t in let th := theta a t in
  0 <= sum n (fun i => sum n (fun j => ((if (S i =? n)%nat && (S j =? n)%nat then 1 else 0) - Q2R (falls a) * at_ (nth i (W a) []) j
    - sum n (fun l => entry_at a z th i l * at_ (nth l (W a) []) j + entry_at a z th j l * at_ (nth i (W a) []) l)) * F (Y i) (Y j))).
Proof.
  intros HF Ht z th. destruct (gain_slope t ltac:(lra)) as [E0 E1]. destruct (T_k a Hprot) as [A B]. fold c in A, B.
  destruct matrices as [_ [_ [_ [M4 _]]]].
  unfold check_decrease in Hdecrease. cbv zeta in Hdecrease. apply andb_prop in Hdecrease as [H H1]. apply andb_prop in H as [HL HC].
  fold n in HL, H1. pose proof begin_ok as BO.
  assert (L1 : forall g, length (fall_table a g) = n) by (intros; unfold fall_table, table; rewrite map_length, seq_length; reflexivity).
  assert (L2 : forall g i, (i < n)%nat -> length (nth i (fall_table a g) []) = n) by (intros g i Hi; apply (table_row n _ i Hi)).
  assert (U0 : uncapped a 0 < uncapped a t).
  { unfold uncapped, gain. fold c. apply Rplus_lt_compat_l. unfold Rdiv. apply Rmult_lt_compat_l; [exact B|]. apply Rinv_lt_contravar; [|lra].
    apply Rmult_lt_0_compat; lra. }
  pose proof (uncapped_pos a Hprot 0 A) as U1. destruct M4 as [R0 R1].
  (* where the gain is free *)
  assert (Free : th = sq (1 - Q2R (slope a) * z) / k c -> eta a t = uncapped a t -> (forall G, cap a = Some G -> uncapped a t <= Q2R G) ->
    0 <= sum n (fun i => sum n (fun j => ((if (S i =? n)%nat && (S j =? n)%nat then 1 else 0) - Q2R (falls a) * at_ (nth i (W a) []) j
    - sum n (fun l => entry_at a z th i l * at_ (nth l (W a) []) j + entry_at a z th j l * at_ (nth i (W a) []) l)) * F (Y i) (Y j)))).
  { intros Eth Eeta Hcap. rewrite Eth. pose proof (entries_ok true z F Y) as EN. cbv beta iota in EN. rewrite <- EN.
    assert (Hup : z <= Q2R (/ begin_gain a)).
    { rewrite inverse_ok, BO by (rewrite BO; lra). unfold z. rewrite Eeta. apply Rinv_le_contravar; lra. }
    assert (Hlow : Q2R match cap a with None => 0 | Some G => / G end <= z).
    { destruct (cap a) as [G|] eqn:EG; [|rewrite Q2R_0; left; apply Rinv_0_lt_compat; exact E0].
      rewrite inverse_ok by (apply R1; reflexivity). unfold z. rewrite Eeta. apply Rinv_le_contravar; [lra|apply Hcap; reflexivity]. }
    destruct points as [|low [|p l]].
    1, 2: destruct (cap a) as [G|] eqn:EG; [|discriminate]; apply Qle_bool_iff, Qle_Rle in H1; rewrite BO in H1; specialize (Hcap G eq_refl); lra.
    apply andb_prop in H1 as [H0 H]. apply Qle_bool_iff, Qle_Rle in H0.
    destruct (points_ok _ _ z (p :: l) low H ltac:(lra) ltac:(discriminate)) as [lo [hi [HI Hz']]].
    apply (interval_ok split a (fall_table a true) lo hi z F Y HF HI HL (L1 true) (L2 true) Hz'). }
  unfold theta in th. change (gain (deadline (graph a)) (Q2R (slope a)) (k (graph a))) with (uncapped a) in *.
  unfold eta in Free at 1. change (gain (deadline (graph a)) (Q2R (slope a)) (k (graph a)) t) with (uncapped a t) in Free.
  destruct (cap a) as [G|] eqn:EG.
  - destruct (Rlt_dec (Q2R G) (uncapped a t)) as [L|L].
    + unfold check_cap in HC. rewrite EG in HC. fold n in HC. pose proof (psd_ok _ _ _ F Y HF HC) as K. unfold double in K.
      assert (Ez : z = Q2R (/ G)).
      { rewrite inverse_ok by (apply R1; reflexivity). unfold z, eta. rewrite EG. f_equal.
        change (gain (deadline (graph a)) (Q2R (slope a)) (k (graph a)) t) with (uncapped a t). apply Rmin_right. lra. }
      pose proof (entries_ok false z F Y) as EN. cbv beta iota in EN. unfold th. rewrite <- EN.
      eapply Rle_trans; [exact K|]. apply Req_le. apply sum_ext. intros i Hi. apply sum_ext. intros j Hj. f_equal. rewrite Ez.
      rewrite <- peval_at. unfold at_. set (f := fun p => reduced (evaluate p (/ G))).
      rewrite nth_indep with (d' := map f []) by (rewrite map_length, L1; exact Hi). rewrite (map_nth (map f)).
      rewrite nth_indep with (d' := f []) by (rewrite map_length, L2 by exact Hi; exact Hj). rewrite (map_nth f). unfold f. apply reduced_ok.
    + apply Free; [reflexivity|apply Rmin_left; lra|]. intros G' E'. injection E' as <-. lra.
  - apply Free; [reflexivity|reflexivity|discriminate].
Qed.
Theorem claim_ok j f : In j (used a) -> nth_error (funcs c) j = Some f -> agent_claim a f.
Proof.
  intros Hj Ef. assert (Hf : In f (funcs c)) by (apply (nth_error_In _ _ Ef)).
  assert (Hc : 1 <= Q2R (coupling a) * Q2R (rate f)).
  { unfold check_coupling in Hcoupling. rewrite forallb_forall in Hcoupling. specialize (Hcoupling j Hj). fold c in Hcoupling. rewrite Ef in Hcoupling.
    apply Qle_bool_iff, Qle_Rle in Hcoupling. rewrite Q2R_mult, Q2R_1 in Hcoupling. exact Hcoupling. }
  rewrite forallb_forall in Hfuncs. specialize (Hfuncs f Hf). unfold check_function in Hfuncs.
  destruct (Checker.form (order c) (dls d) (dL d) (ly f)) as [[F m]|] eqn:EF; [|discriminate].
  apply andb_prop in Hfuncs as [H H4]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  pose proof (Main.Hls c Hedges) as HL. fold d in HL.
  set (S := pair (edges c) (ly f)). assert (PS : positive S) by (apply (pair_positive c f HL F m EF H2)).
  destruct matrices as [M1 [M2 [M3 [M4 [M5 [M6 [M7 M8]]]]]]].
  assert (Wsym : forall i j, (i < n)%nat -> (j < n)%nat -> at_ (nth i (W a) []) j = at_ (nth j (W a) []) i)
    by (intros; apply (psd_symmetric split n); assumption).
  intros off X Sl t HX Ht v. fold c in Ht.
  assert (D : value a f (y a off (X t) t) <= v).
  { apply (value_falls a off X Sl Hprot M4 M5 HX f (Q2R (falls a))); [| | | |exact Ht].
    - apply (pair_derive c f HL F m EF).
    - apply (pair_continuous c f HL F m EF).
    - exact PS.
    - intros u Y Hu m'. apply (falling S (lap (edges c)) n (fun i j => at_ (nth i (W a) []) j) (fun i j => at_ (nth i (P a) []) j)
        (entry_at a (/ eta a u) (theta a u)) (at_ (gains a)) (Q2R (coupling a)) (Q2R (falls a)) (Q2R (rate f)) Y PS);
        try assumption.
      + intros. apply lap_comb.
      + apply (pair_rate c f HL F m EF H1).
      + split; assumption.
      + apply (falls_ok S (fun i => comb n (fun l => at_ (nth i (P a) []) l) Y) u PS Hu). }
  split; [exact D|]. intros b cs i jj Edev Hi Hjj. rewrite Edev in H4. unfold away. set (x := placed off (X t) i).
  set (dev := fun z : nat -> R => z jj - end_state c z jj).
  assert (DV : forall z, 0 <= at_ cs jj /\ sq (dev z) <= at_ cs jj * S z z).
  { intros z. destruct (deviation_ok c Hedges Hend f F m EF b cs H4 z) as [_ K]. specialize (K jj Hjj).
    unfold S. rewrite (pair_self c f HL F m EF). exact K. }
  assert (PD : positive (fun z z' => at_ cs jj * S z z' - dev z * dev z')).
  { constructor.
    - intros. rewrite (swaps S PS). ring.
    - intros. rewrite (adds S PS). unfold dev. rewrite (end_plus a). fold c. ring.
    - intros. rewrite (scales S PS). unfold dev. rewrite (end_scal a). fold c. ring.
    - intros z. destruct (DV z) as [_ K]. unfold sq in K. lra. }
  assert (E : x = fun j => eta a t ^ i * y a off (X t) t i j).
  { apply functional_extensionality. intros j'. apply (y_times a off Hprot M4). apply Ht. }
  assert (Ex : x jj - end_state (graph a) x jj = eta a t ^ i * dev (y a off (X t) t i)).
  { rewrite E. rewrite (end_scal a). fold c. unfold dev. ring. }
  rewrite Ex. unfold sq at 1 2. replace (eta a t ^ i * dev (y a off (X t) t i) * (eta a t ^ i * dev (y a off (X t) t i)))
    with (eta a t ^ i * eta a t ^ i * sq (dev (y a off (X t) t i))) by (unfold sq; ring).
  apply Rmult_le_compat_l; [apply Rle_0_sqr|].
  assert (WP : forall u : nat -> R, 0 <= sum n (fun i => sum n (fun j => at_ (nth i (W a) []) j * (u i * u j)))) by (apply definite_ok).
  pose proof (one_part S n (fun i j => at_ (nth i (W a) []) j) (fun i j => at_ (nth i (P a) []) j) (y a off (X t) t) PS Wsym M7
    dev (at_ cs jj) i) as K. cbv beta in K.
  assert (K' : sq (dev (y a off (X t) t i)) <= at_ (nth i (W a) []) i * (at_ cs jj * value a f (y a off (X t) t))).
  { apply K; [|intros Z; apply (psd_ok split n (W a) _ Z PD M1)|exact WP|exact Hi].
    intros l Z. unfold dev. rewrite (end_comb a). fold c. unfold comb at 1. rewrite (sum_ext n (fun i0 => l i0 * (Z i0 jj - end_state c (Z i0) jj))
      (fun i0 => l i0 * Z i0 jj + -1 * (l i0 * end_state c (Z i0) jj))) by (intros; ring). rewrite sum_plus, sum_scal. ring. }
  eapply Rle_trans; [exact K'|]. destruct (DV (fun _ => 0)) as [C0 _].
  assert (W0 : 0 <= at_ (nth i (W a) []) i).
  { specialize (WP (fun l => if (i =? l)%nat then 1 else 0)).
    rewrite (sum_ext n _ (fun l => (if (i =? l)%nat then 1 else 0) * sum n (fun j => (if (i =? j)%nat then 1 else 0) * at_ (nth l (W a) []) j))) in WP.
    - rewrite (sum_at' n i (fun l => sum n (fun j => (if (i =? j)%nat then 1 else 0) * at_ (nth l (W a) []) j))),
        (sum_at' n i (fun j => at_ (nth i (W a) []) j)) in WP by exact Hi. exact WP.
    - intros l _. rewrite <- sum_scal. apply sum_ext. intros. ring. }
  replace (at_ cs jj * at_ (nth i (W a) []) i * v) with (at_ (nth i (W a) []) i * (at_ cs jj * v)) by ring.
  apply Rmult_le_compat_l; [exact W0|]. apply Rmult_le_compat_l; [exact C0|exact D].
Qed.
(** * Where they end *)
Hypothesis Hagree : check_agree a = true.
Hypothesis Hcommon : check_common a = true.
Hypothesis Hends : check_ends_of a = true.
Lemma part_ok q m : Q2R (part q m) = Q2R q ^ m / INR (fact m).
Proof.
  induction m as [|m IH]; cbn [part]; [rewrite Q2R_1; simpl; field|].
  assert (N : ~ (index (S m) == 0)%Q) by (unfold index, inject_Z, Qeq; simpl; lia).
  rewrite Q2R_mult, Q2R_div, IH, index_ok by exact N. change (fact (S m)) with (S m * fact m)%nat. rewrite mult_INR, <- tech_pow_Rmult.
  pose proof (INR_fact_neq_0 m). assert (INR (S m) <> 0) by (apply not_0_INR; lia). field. split; assumption.
Qed.
(** at the deadline what is known to tend to something *)
Lemma agrees off X Sl i j : flies a off X Sl -> (i < n)%nat -> (j < order c)%nat -> agree a = true ->
  filterlim (fun t => away a off (X t) i j) (at_left (deadline c)) (locally 0).
Proof.
  intros HX Hi Hj HA. destruct matrices as [M1 [M2 [M3 [M4 [M5 [M6 [M7 M8]]]]]]].
  unfold check_agree in Hagree. rewrite HA in Hagree. cbn [negb orb] in Hagree. apply andb_prop in Hagree as [G3 G].
    assert (EC : cap a = None) by (destruct (cap a); [discriminate|reflexivity]). apply orb_prop in G as [G|G].
    { apply (filterlim_ext (fun _ => 0)); [|apply filterlim_const]. intros t. unfold away. pose proof (nothing_left c Hend G (placed off (X t) i) j Hj) as K.
      fold c. lra. }
    apply andb_prop in G as [G1 G2].
    apply existsb_exists in G2 as [kf [Hk G2]]. destruct (nth_error (funcs (graph a)) kf) as [f|] eqn:Ef; [|discriminate].
    destruct (deviation f) as [[b cs]|] eqn:Ed; [|discriminate].
    pose proof (claim_ok kf f Hk Ef off X Sl) as CL.
    apply negb_true_iff in G1. destruct (Qlt_le_dec (2 * index (pred n)) (falls a * pull_in a)) as [L|L]; [|apply Qle_bool_iff in L; unfold n in L; congruence].
    apply Qlt_Rlt in L. rewrite index_2, Q2R_mult, pull_ok in L.
    set (C := at_ cs j * at_ (nth i (W a) []) i * value a f (y a off (X 0) 0)).
    assert (B : forall t, 0 <= t < deadline (graph a) -> sq (away a off (X t) i j) <= sq (eta a t ^ i) * (C * exp (- (Q2R (falls a) * turns a t)))).
    { intros t Ht. destruct (CL t HX Ht) as [_ K]. specialize (K b cs i j Ed Hi Hj). cbv zeta in K. eapply Rle_trans; [exact K|].
      apply Req_le. unfold C. ring. }
    apply (vanishes a Hprot M4 _ i (Q2R (falls a)) (Rmax 0 C) EC).
    - apply Rmax_l.
    - eapply Rle_lt_trans; [|exact L]. apply Rmult_le_compat_l; [lra|]. apply le_INR. unfold n in *. lia.
    - intros t Ht. eapply Rle_trans; [apply (B t Ht)|]. apply Rmult_le_compat_l; [apply Rle_0_sqr|].
      apply Rmult_le_compat_r; [left; apply exp_pos|apply Rmax_r].
Qed.
Definition chain_drift (i l : nat) : R := if (i <=? l)%nat then deadline c ^ (l - i) / INR (fact (l - i)) else 0.
Lemma chains_end off X Sl i j : forallb (Qeq_bool 0) (plant a ++ damping a) = true -> flies a off X Sl -> (i < n)%nat -> (j < order c)%nat ->
  filterlim (fun t => X t i j - away a off (X t) i j) (at_left (deadline c)) (locally (outcome a chain_drift off (X 0) i j)).
Proof.
  intros Z HX Hi Hj. destruct matrices as [_ [_ [_ [_ [M5 _]]]]]. rewrite forallb_app in Z. apply andb_prop in Z as [Z1 Z2].
  destruct (T_k a Hprot) as [T0 K0]. fold c in T0, K0. set (T := deadline c) in *.
  set (wj := fun t => taylor (n - i) (fun l => end_state c (placed off (X (Rmax 0 0)) (i + l)) j) t).
  assert (EO : outcome a chain_drift off (X 0) i j = (if (i =? 0)%nat then off j else 0) + wj T).
  { unfold outcome. f_equal. fold n c. unfold wj, taylor. rewrite Rmax_left by lra.
    rewrite <- (sum_from i n (fun u v => T ^ u / INR (fact u) * end_state c (placed off (X 0) v) j)) by (unfold n in *; lia).
    apply sum_ext. intros l Hl. unfold chain_drift. fold T. destruct (i <=? l)%nat; ring. }
  rewrite EO. apply (common_ends a Hprot off X i j (wj T) wj).
  - intros t Ht. pose proof (drifts a off X Sl Hedges Hend Hprot M5 HX (fun l => zeros _ l Z2) (fun l => zeros _ l Z1) j (n - i) i
      ltac:(unfold n in *; lia) ltac:(unfold n in *; lia) t Ht) as K. cbv beta zeta in K. rewrite (Rmax_right 0 t) in K by lra. exact K.
  - eapply filterlim_filter_le_1; [|apply (@ex_derive_continuous _ _ wj T)].
    + intros P [e He]. exists e. intros u Hu _. apply He. exact Hu.
    + destruct (n - i)%nat as [|u] eqn:Eu; [unfold n in *; lia|]. unfold wj. eexists. apply taylor_derive.
Qed.
Definition rest_drift (m : R) (i l : nat) : R := match i, l with O, O => 1 | O, 1%nat => m | _, _ => 0 end.
(** the common motion of agents that meet at rest: how far they glide, and that [drift] holds it *)
Lemma rest_inside M : positive_gain a -> drift a = Some M -> check_rest a M = true -> degree a = 2%nat /\ cap a = None /\
  0 = at_ (plant a) 0 /\ 0 = at_ (damping a) 0 /\ 0 < at_ (damping a) 1 /\
  exists m, filterlim (glide a (at_ (plant a) 1) (at_ (damping a) 1)) (at_left (deadline c)) (locally m) /\ inside a (rest_drift m).
Proof.
  intros M4 EM HC. unfold check_rest in HC. cbv zeta in HC.
    set (p := (nth 1 (damping a) 0 * pull_in a)%Q) in *. set (w := ((nth 1 (plant a) 0 + nth 1 (damping a) 0 * slope a) * span (graph a))%Q) in *.
    set (x := fst (far_q p w)) in *. set (e := snd (far_q p w)) in *.
    apply andb_prop in HC as [H N4]. apply andb_prop in H as [H N3]. apply andb_prop in H as [H N2]. apply andb_prop in H as [H N1].
    apply andb_prop in H as [H C6]. apply andb_prop in H as [H C5]. apply andb_prop in H as [H C4]. apply andb_prop in H as [H C3]. apply andb_prop in H as [C1 C2].
    apply Nat.eqb_eq in C1. assert (EC : cap a = None) by (destruct (cap a); [discriminate|reflexivity]).
    apply Qeq_bool_eq, Qeq_eqR in C3, C4. rewrite Q2R_0 in C3, C4. apply Qpos in C5. apply negb_true_iff in C6.
    assert (Ep : Q2R p = at_ (damping a) 1 * k c) by (unfold p; rewrite Q2R_mult, pull_ok; reflexivity).
    assert (Ew : Q2R w = (at_ (plant a) 1 + at_ (damping a) 1 * Q2R (slope a)) * deadline c) by (unfold w; rewrite !Q2R_mult, Q2R_plus, Q2R_mult; fold c; rewrite span_ok; reflexivity).
    assert (P0 : 0 < Q2R p) by (rewrite Ep; apply Rmult_lt_0_compat; [exact C5|apply (T_k a Hprot)]).
    destruct (far_ok p w P0) as [Po [dP [DP [Ex He]]]]. fold x in Ex. fold e in He.
    destruct (glides a (Q2R p) (Q2R w) (at_ (plant a) 1) (at_ (damping a) 1) (Q2R e) Po dP Hprot M4 EC C5 Ep Ew DP He) as [m [L [m0 B]]]. fold c in L, B.
    rewrite <- Ex in B.
    do 5 (split; [assumption|]). exists m. split; [exact L|]. intros M' i l E Hi Hl. rewrite EM in E. injection E as <-. rewrite C1 in Hi, Hl.
      destruct i as [|[|i]]; [| |lia]; (destruct l as [|[|l]]; [| |lia]); cbn [rest_drift].
      * apply (near_at _ _ _ N1). apply Q2R_1.
      * apply (near_ok _ _ _ _ N2). assert (E2 : Q2R e < 1) by (destruct (Qlt_le_dec e 1) as [Q|Q]; [apply Qlt_Rlt in Q; rewrite Q2R_1 in Q; exact Q|apply Qle_bool_iff in Q; congruence]).
        assert (E3 : 0 <= Q2R e) by (eapply Rle_trans; [apply Rabs_pos|apply (He 0); lra]).
        assert (ED : Q2R (1 - e) = 1 - Q2R e) by (rewrite Q2R_minus, Q2R_1; reflexivity).
        rewrite !Q2R_mult, Q2R_div, ED by (intros Q; apply Qeq_eqR in Q; rewrite ED, Q2R_0 in Q; lra). rewrite abs_ok, Q2R_mult. fold c. rewrite span_ok.
        set (z := deadline c * Q2R x) in *.
        rewrite Rabs_minus_sym. eapply Rle_trans; [exact B|]. pose proof (Rle_abs z) as X1. pose proof (Rle_abs (m - z)) as X2.
        assert (X3 : m * (1 - Q2R e) <= Rabs z) by lra. unfold Rdiv. rewrite Rmult_assoc. apply Rmult_le_compat_l; [exact E3|].
        apply (Rmult_le_reg_r (1 - Q2R e)); [lra|]. rewrite (Rmult_comm (/ _)), Rmult_assoc, Rinv_l by lra. lra.
      * apply (near_at _ _ _ N3). apply Q2R_0.
      * apply (near_at _ _ _ N4). apply Q2R_0.
Qed.
Theorem agreement_ok : agreement a.
Proof.
  destruct (drift a) as [M|] eqn:EM; [|exists (fun _ _ => 0); split; [intros M i l E; rewrite EM in E; discriminate|]; intros off X Sl i j HX Hi Hj tends;
    split; [apply (agrees off X Sl); assumption|intros E; contradiction]].
  pose proof Hcommon as HC. unfold check_common in HC. rewrite EM in HC. destruct (forallb (Qeq_bool 0) (plant a ++ damping a)) eqn:Z.
  - exists chain_drift. split.
    + intros M' i l E Hi Hl. rewrite EM in E. injection E as <-. pose proof (square_ok _ _ HC i l Hi Hl) as K. cbv beta in K.
      apply (near_at _ _ _ K). unfold chain_drift. destruct (i <=? l)%nat; [|apply Q2R_0]. rewrite part_ok. fold c. rewrite span_ok. reflexivity.
    + intros off X Sl i j HX Hi Hj tends. split; [apply (agrees off X Sl); assumption|]. intros _. apply (chains_end off X Sl); assumption.
  - destruct (forallb (Qeq_bool 0) (damping a)) eqn:ZD.
  { destruct matrices as [_ [_ [_ [_ [M5 _]]]]]. destruct (solutions a Hprot) as [X HX]. exists (fun i l => X l (deadline c) i). split.
    - intros M' i l E Hi Hl. rewrite EM in E. injection E as <-. apply (drag_inside a Hprot M5 M X HC HX i l Hi Hl).
    - intros off Z' Sl i j HZ Hi Hj tends. split; [apply (agrees off Z' Sl); assumption|]. intros _. apply (drag_ends a Hedges Hprot Hend M5 X off Z' Sl); assumption. }
  destruct matrices as [_ [_ [_ [M4 _]]]].
  destruct (rest_inside M M4 EM HC) as [C1 [EC [C3 [C4 [C5 [m [L I]]]]]]]. exists (rest_drift m). split; [exact I|].
    + intros off X Sl i j HX Hi Hj tends. split; [apply (agrees off X Sl); assumption|]. intros _. fold n in Hi. unfold n in Hi. rewrite C1 in Hi.
      assert (W : forall t, 0 <= t < deadline c -> (fun u => X (Rmax 0 u)) t = X t) by (intros t Ht; cbv beta; rewrite Rmax_right by lra; reflexivity).
      unfold outcome. rewrite C1. unfold sum. cbn [seq fold_right rest_drift]. fold c.
      set (v0 := end_state c (placed off (X 0) 0) j). set (v1 := end_state c (placed off (X 0) 1) j).
      destruct i as [|[|i]]; [| |lia].
      * cbn [rest_drift]. replace (1 * v0 + (m * v1 + 0)) with (v0 + m * v1) by ring.
        apply (common_ends a Hprot off X 0 j (v0 + m * v1) (fun t => v0 + glide a (at_ (plant a) 1) (at_ (damping a) 1) t * v1)).
        -- intros t Ht. pose proof (position a off X Sl Hedges Hend Hprot M4 HX C1 (eq_sym C3) (eq_sym C4) j t Ht) as K. cbv beta zeta in K.
           rewrite (Rmax_right 0 t), (Rmax_right 0 0) in K by lra. exact K.
        -- apply (filterlim_comp _ _ _ (glide a (at_ (plant a) 1) (at_ (damping a) 1)) (fun y => v0 + y * v1) (at_left (deadline c)) (locally m)); [exact L|].
           apply (continuous_plus (fun _ => v0) (fun y => y * v1)); [apply continuous_const|].
           apply (continuous_mult (fun y => y) (fun _ => v1)); [apply continuous_id|apply continuous_const].
      * cbn [rest_drift]. replace (0 * v0 + (0 * v1 + 0)) with 0 by ring.
        apply (common_ends a Hprot off X 1 j 0 (fun t => fades a (at_ (plant a) 1) (at_ (damping a) 1) t * v1)); [|apply (fades_vanish a _ _ Hprot M4 EC C5)].
        intros t Ht. pose proof (velocity a off X Sl Hedges Hend Hprot M4 HX C1 (eq_sym C3) (eq_sym C4) j t Ht) as K. cbv beta zeta in K.
        rewrite (Rmax_right 0 t), (Rmax_right 0 0) in K by lra. exact K.
Qed.
Lemma dotq_ok l : forall x, Q2R (dotq l x) = qdot l (at_ x).
Proof.
  induction l as [|q l IH]; intros [|v x]; cbn [dotq qdot]; try apply Q2R_0.
  - rewrite (qdot_ext _ _ (fun i => 0 * 1)) by (intros i _; unfold shift, at_; destruct i; simpl; rewrite Q2R_0; ring).
    rewrite qdot_scal. unfold at_. simpl. rewrite Q2R_0. ring.
  - rewrite reduced_ok, Q2R_plus, Q2R_mult, IH. reflexivity.
Qed.
Lemma ends_q_ok x j : (j < order c)%nat -> Q2R (nth j (ends_q c x) 0%Q) = end_state c (at_ x) j.
Proof.
  intros Hj. unfold ends_q. cbv zeta. rewrite nth_map_seq by exact Hj. rewrite reduced_ok. unfold end_state.
  induction (balanced_comps (comps c)) as [|b l IH]; simpl; [apply Q2R_0|]. rewrite Q2R_plus, Q2R_mult, IH, dotq_ok. reflexivity.
Qed.
Lemma less_ok x : forall v j, length x = length v -> at_ (less x v) j = at_ x j - at_ v j.
Proof.
  unfold at_, less. induction x as [|q x IH]; intros [|u v] j L; simpl in *; try discriminate.
  - destruct j; rewrite Q2R_0; ring.
  - destruct j as [|j]; simpl; [apply Q2R_minus|]. apply IH. lia.
Qed.
Lemma sum_abs m f : Rabs (sum m f) <= sum m (fun i => Rabs (f i)).
Proof.
  unfold sum. induction (seq 0 m) as [|i l IH]; cbn [fold_right]; [rewrite Rabs_R0; lra|]. eapply Rle_trans; [apply Rabs_triang|]. lra.
Qed.
Theorem ends_ok : ends_claim a.
Proof.
  intros r x i j ED Hr Hx Hi Hj p. unfold check_ends_of in Hends. destruct (drift a) as [M|] eqn:EM; [|contradiction]. rewrite forallb_forall in Hends.
  specialize (Hends x Hx). unfold check_axis in Hends. cbv zeta in Hends. apply andb_prop in Hends as [H H4].
  apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2]. apply Nat.leb_le in H1. apply Nat.eqb_eq in H2, H3.
  rewrite forallb_forall in H4. specialize (H4 i ltac:(apply in_seq; lia)). rewrite forallb_forall in H4.
  specialize (H4 j ltac:(apply in_seq; lia)). fold p in H4. apply (near_ok _ _ _ _ H4).
  assert (EE : forall l, (l < n)%nat -> Q2R (cell (map (fun l => ends_q (graph a) (placed_q x l)) (seq 0 (degree a))) l j)
    = end_state c (placed (at_ (offsets x)) (fun l => at_ (nth l (begins x) [])) l) j).
  { intros l Hl. unfold cell. rewrite nth_map_seq by exact Hl. fold c. rewrite ends_q_ok by exact Hj. f_equal. apply functional_extensionality. intros v.
    unfold placed, placed_q. cbv zeta. destruct (Nat.eqb_spec l 0) as [->|]; [apply less_ok; congruence|ring]. }
  unfold row_times. rewrite Q2R_plus, !qsum_ok. unfold outcome. fold n c.
  rewrite (sum_ext n (fun l => Q2R (_ * Qabs _)) (fun l => Q2R (snd (entry_of M i l)) * Rabs (end_state c (placed (at_ (offsets x)) (fun l => at_ (nth l (begins x) [])) l) j)))
    by (intros l Hl; rewrite Q2R_mult, abs_ok; f_equal; f_equal; apply EE; exact Hl).
  rewrite (sum_ext n (fun l => Q2R (fst _ * _)) (fun l => Q2R (fst (entry_of M i l)) * end_state c (placed (at_ (offsets x)) (fun l => at_ (nth l (begins x) [])) l) j))
    by (intros l Hl; rewrite Q2R_mult; f_equal; apply EE; exact Hl).
  set (E := fun l => end_state c (placed (at_ (offsets x)) (fun l => at_ (nth l (begins x) [])) l) j).
  assert (E0 : Q2R (if (i =? 0)%nat then nth j (offsets x) 0%Q else 0%Q) = if (i =? 0)%nat then at_ (offsets x) j else 0) by (destruct (i =? 0)%nat; [reflexivity|apply Q2R_0]).
  rewrite E0. match goal with |- Rabs ?u <= _ => replace u with (sum n (fun l => (Q2R (fst (entry_of M i l)) - r i l) * E l)) end.
  - eapply Rle_trans; [apply sum_abs|]. apply sum_le. intros l Hl. rewrite Rabs_mult. apply Rmult_le_compat_r; [apply Rabs_pos|].
    apply (Hr M i l EM); [unfold n in *; lia|exact Hl].
  - rewrite (sum_ext n _ (fun l => Q2R (fst (entry_of M i l)) * E l + -1 * (r i l * E l))) by (intros; ring). rewrite sum_plus, sum_scal. unfold E. ring.
Qed.

(** * The input *)
Hypothesis Htops : check_tops a = true.
Lemma powq_ok q m : Q2R (powq q m) = Q2R q ^ m.
Proof. induction m as [|m IH]; simpl; [apply Q2R_1|]. rewrite Q2R_mult, IH. reflexivity. Qed.
Lemma rows_ok x i j : length (offsets x) = order c -> length (nth 0 (begins x) []) = order c -> (i < n)%nat ->
  at_ (nth i (begin_rows a x) []) j = y a (at_ (offsets x)) (fun l => at_ (nth l (begins x) [])) 0 i j.
Proof.
  intros L1 L2 Hi. unfold begin_rows. cbv zeta. fold n. rewrite nth_map_seq by exact Hi.
  assert (E : forall u (g : Q -> Q), Q2R (g 0%Q) = 0 -> at_ (map g u) j = Q2R (g (nth j u 0%Q))).
  { intros u g G. unfold at_. destruct (Nat.lt_ge_cases j (length u)) as [L|L].
    - rewrite nth_indep with (d' := g 0%Q) by (rewrite map_length; exact L). rewrite map_nth. reflexivity.
    - rewrite !nth_overflow by (try rewrite map_length; exact L). rewrite G. apply Q2R_0. }
  rewrite E by (rewrite reduced_ok, Q2R_mult, Q2R_0; ring). rewrite reduced_ok, Q2R_mult, powq_ok. unfold y.
  pose proof first_ok as E0. assert (P0 : 0 < eta a 0) by (apply gain_slope; split; [lra|apply (T_k a Hprot)]).
  rewrite inverse_ok by (rewrite E0; exact P0). rewrite E0. unfold Rdiv. rewrite <- pow_inv. f_equal.
  unfold placed_q, placed. cbv zeta. change (Q2R (nth j ?u 0%Q)) with (at_ u j).
  destruct (Nat.eqb_spec i 0) as [->|]; [apply less_ok; congruence|unfold at_; ring].
Qed.
Lemma worth_ok f F m rows x : Checker.form (order c) (dls d) (dL d) (ly f) = Some (F, m) -> check_rows (order c) rows = true -> length rows = n ->
  (forall i, (i < n)%nat -> at_ (nth i rows []) = x i) -> Q2R (worth_q a F m rows) = value a f x.
Proof.
  intros EF HR HL Hx. pose proof (Main.Hls c Hedges) as Hl. fold d in Hl.
  destruct (form_ok _ _ _ _ _ _ _ Hl eq_refl EF) as [M _]. apply IZR_lt in M.
  unfold check_rows in HR. rewrite forallb_forall in HR. set (e := common (concat rows)) in *.
  unfold worth_q. fold n. cbv zeta. fold e. rewrite qsum_ok. unfold value, double. fold n. apply sum_ext. intros i Hi.
  rewrite qsum_ok. apply sum_ext. intros j Hj. rewrite reduced_ok, Q2R_mult. change (Q2R (cell (P a) i j)) with (at_ (nth i (P a) []) j). f_equal.
  assert (Gd : forall l, (l < n)%nat -> good e (nth l rows []) = true).
  { intros l Hl'. assert (K : In (nth l rows []) rows) by (apply nth_In; lia). specialize (HR _ K). apply andb_prop in HR. apply HR. }
  assert (E0 : 0 < IZR e) by (apply IZR_lt; apply (good_ok _ _ (Gd i Hi))).
  assert (Vx : forall l, (l < n)%nat -> vec_of (map (scaled e) (nth l rows [])) = fun v => IZR e * x l v).
  { intros l Hl'. apply functional_extensionality. intros v. unfold vec_of. rewrite nth_scaled by (apply Gd; exact Hl').
    rewrite <- (Hx l Hl'). reflexivity. }
  assert (EG : forall l v, (l < n)%nat -> (v < n)%nat -> IZR (nth v (nth l (map (fun z => map (zdot (lincomb z F)) (map (map (scaled e)) rows))
      (map (map (scaled e)) rows)) []) 0%Z) = IZR e * IZR e * bil F (x l) (x v)).
  { intros l v Hl' Hv. set (zs := map (map (scaled e)) rows). assert (Lz : length zs = n) by (unfold zs; rewrite map_length; exact HL).
    rewrite nth_indep with (d' := (fun z => map (zdot (lincomb z F)) zs) []) by (rewrite map_length; exact (eq_ind_r (fun q => (l < q)%nat) Hl' Lz)).
    rewrite (map_nth (fun z => map (zdot (lincomb z F)) zs)).
    rewrite nth_indep with (d' := zdot (lincomb (nth l zs []) F) []) by (rewrite map_length; exact (eq_ind_r (fun q => (v < q)%nat) Hv Lz)).
    rewrite (map_nth (zdot (lincomb (nth l zs []) F))). rewrite <- zdot_ok, <- bil_vec_l.
    assert (Ez : forall u, (u < n)%nat -> vec_of (nth u zs []) = fun q => IZR e * x u q).
    { intros u Hu. unfold zs. rewrite (nth_indep _ [] (map (scaled e) [])) by (rewrite map_length, HL; exact Hu). rewrite map_nth. apply Vx. exact Hu. }
    rewrite !Ez by assumption. rewrite bil_scal_l, bil_scal_r. ring. }
  rewrite (pair_bil c f Hl F m EF).
  assert (IZ : forall u, Q2R (inject_Z u) = IZR u) by (intros u; unfold Q2R; simpl; field).
  assert (NZ : ~ (inject_Z (2 * m * (e * e)) == 0)%Q).
  { intros Z. apply Qeq_eqR in Z. rewrite IZ, Q2R_0, !mult_IZR in Z.
    assert (0 < 2 * IZR m * (IZR e * IZR e)) by (apply Rmult_lt_0_compat; [lra|apply Rmult_lt_0_compat; assumption]). lra. }
  rewrite Q2R_div by exact NZ.
  rewrite !IZ, plus_IZR, !EG, !mult_IZR by assumption. field. split; lra.
Qed.
Lemma value_ext f F m x z : Checker.form (order c) (dls d) (dL d) (ly f) = Some (F, m) ->
  (forall i j, (i < n)%nat -> (j < order c)%nat -> x i j = z i j) -> value a f x = value a f z.
Proof.
  intros EF H. pose proof (Main.Hls c Hedges) as Hl. fold d in Hl. destruct (form_ok _ _ _ _ _ _ _ Hl eq_refl EF) as [_ [Hfit _]].
  destruct (fits_ok _ _ Hfit) as [F1 F2]. unfold value. apply double_ext. intros i j Hi Hj. fold c. rewrite !(pair_bil c f Hl F m EF).
  assert (E : forall u v, (u < n)%nat -> (v < n)%nat -> bil F (x u) (x v) = bil F (z u) (z v)).
  { intros u v Hu Hv. rewrite (bil_ext_l F (x u) (z u)) by (intros; apply H; [assumption|lia]).
    apply (bil_ext_r F (order c)); [exact F2|]. intros; apply H; assumption. }
  rewrite !E by assumption. reflexivity.
Qed.
Lemma qsum_list {A} (g : A -> Q) l x0 : Q2R (qsum (map g l)) = sum (length l) (fun i => Q2R (g (nth i l x0))).
Proof.
  induction l as [|x l IH]; [apply Q2R_0|]. cbn [map length]. rewrite sum_front. cbn [nth]. rewrite <- IH. unfold qsum. cbn [fold_right].
  apply Q2R_plus.
Qed.
(** over space, from the states of the file on *)
Lemma begins_ok f F m X Sl : Checker.form (order c) (dls d) (dL d) (ly f) = Some (F, m) -> check_begins a = true -> begun a X Sl ->
  Q2R (worth_all a F m) = sum (length (axes a)) (fun i => value a f (y a (spot a i) (X i 0) 0)).
Proof.
  intros EF HB HX. unfold check_begins in HB. cbv zeta in HB. apply andb_prop in HB as [H5 H6]. rewrite forallb_forall in H5, H6.
  unfold worth_all. rewrite map_map. set (dflt := Axis [] [] []). rewrite (qsum_list _ _ dflt). apply sum_ext. intros i Hi.
  assert (HXi : nth_error (axes a) i = Some (nth i (axes a) dflt)) by (apply nth_error_nth'; exact Hi).
  destruct (HX _ i HXi) as [_ HB0]. assert (Ai : In (nth i (axes a) dflt) (axes a)) by (apply nth_In; exact Hi).
  specialize (H5 _ Ai). apply andb_prop in H5 as [L1 L2]. apply Nat.eqb_eq in L1, L2.
  rewrite (worth_ok f F m (begin_rows a (nth i (axes a) dflt)) (y a (spot a i) (fun u => at_ (nth u (begins (nth i (axes a) dflt)) [])) 0) EF).
  - apply (value_ext f F m _ _ EF). intros u w Hu Hw. unfold y, placed. rewrite (HB0 u w Hu Hw). reflexivity.
  - apply H6. apply in_map. exact Ai.
  - unfold begin_rows. cbv zeta. rewrite map_length, seq_length. reflexivity.
  - intros u Hu. apply functional_extensionality. intros w. apply rows_ok; assumption.
Qed.
(** the relative part of the input *)
Lemma relative_ok kf f F m v cs cn off X Sl t j : In kf (used a) -> nth_error (funcs c) kf = Some f ->
  bounds_of c d f = Some (v, cs, cn) -> Checker.form (order c) (dls d) (dL d) (ly f) = Some (F, m) ->
  fits (order c) (dL d) = true -> good (common (start c)) (start c) = true ->
  flies a off X Sl -> 0 <= t < deadline c -> (j < order c)%nat -> forall g,
  exp (- (Q2R (falls a) * turns a t)) * eta a t ^ (2 * n) <= g ^ (2 * n) -> sq (eta a t ^ n * sum n (fun i => at_ (gains a) i * lap (edges c) (y a off (X t) t i) j))
    <= g ^ (2 * n) * (Q2R (coupling a) * at_ (gains a) (pred n)) * value a f (y a off (X 0) 0) * at_ cs j.
Proof.
  intros Hu Ef EB EF Hfit Gs HX Ht Hj g PW. destruct matrices as [M1 [M2 [M3 [M4 [M5 [M6 [M7 M8]]]]]]].
  pose proof (nth_error_In _ _ Ef) as Hf. pose proof Hfuncs as HC. rewrite forallb_forall in HC. specialize (HC f Hf). unfold check_function in HC.
  fold c d in HC. rewrite EF in HC. apply andb_prop in HC as [HC _]. apply andb_prop in HC as [HC H3]. apply andb_prop in HC as [_ H2].
  pose proof (Main.Hls c Hedges) as Hl. fold d in Hl.
  assert (B : forall x, sq (lap (edges c) x j) <= at_ cs j * V (edges c) (ly f) x).
  { intros x. destruct (bounds_ok c Hl (fun e He => Main.Hsrc c Hedges e He) Hfit Gs (at_ (start c)) (fun _ _ => eq_refl) f v cs cn H3 H2 EB) as [_ [K _]].
    apply (K x j Hj). }
  destruct (claim_ok kf f Hu Ef off X Sl t HX Ht) as [CV _].
  set (S := pair (edges c) (ly f)). assert (PS : positive S) by (apply (pair_positive c f Hl F m EF H2)).
  set (ell := fun x : nat -> R => lap (edges c) x j).
  assert (C0 : 0 <= at_ cs j \/ forall x, V (edges c) (ly f) x = 0).
  { destruct (Rle_lt_dec 0 (at_ cs j)) as [|Ng]; [left; assumption|right]. intros x. specialize (B x).
    pose proof (above0 S PS x) as V0. unfold S in V0. rewrite (pair_self c f Hl F m EF) in V0. pose proof (Rle_0_sqr (lap (edges c) x j)).
    unfold sq, Rsqr in *. nra. }
  assert (PD : positive (fun x z => at_ cs j * S x z - ell x * ell z)).
  { constructor.
    - intros. rewrite (swaps S PS). ring.
    - intros x x' z. rewrite (adds S PS). unfold ell.
      assert (EL : lap (edges c) (fun i => x i + x' i) j = lap (edges c) x j + lap (edges c) x' j).
      { transitivity (1 * lap (edges c) x j + lap (edges c) x' j); [|ring]. rewrite <- lap_two. f_equal. apply functional_extensionality. intros. ring. }
      rewrite EL. ring.
    - intros. rewrite (scales S PS). unfold ell. rewrite lap_scal. ring.
    - intros z. specialize (B z). unfold S. rewrite (pair_self c f Hl F m EF). unfold ell, sq in *. lra. }
  set (w := fun i j => at_ (nth i (W a) []) j). set (K := at_ (gains a)). set (Y := y a off (X t) t).
  assert (WP : forall u : nat -> R, 0 <= sum n (fun i => sum n (fun j => w i j * (u i * u j)))) by (apply definite_ok).
  assert (A : sq (ell (comb n K Y)) <= sum n (fun i => sum n (fun j => w i j * (K i * K j))) * (at_ cs j * value a f Y)).
  { apply (any_part S n w (fun i j => at_ (nth i (P a) []) j) Y PS).
    - intros u z Hu' Hz. apply (psd_symmetric split n); assumption.
    - exact M7.
    - intros l Z. unfold ell. rewrite lap_comb. reflexivity.
    - intros Z. apply (psd_ok split n (W a) _ Z PD M1).
    - exact WP. }
  assert (EK : sum n (fun i => sum n (fun j => w i j * (K i * K j))) = Q2R (coupling a) * K (pred n)).
  { rewrite (sum_ext n _ (fun i => (if (pred n =? i)%nat then Q2R (coupling a) * K i else 0))); [apply (sum_at n (pred n)); lia|].
    intros i Hi. transitivity (K i * sum n (fun j => w i j * K j)); [rewrite <- sum_scal; apply sum_ext; intros; ring|].
    change (sum n (fun j => w i j * K j)) with (sum n (fun l => at_ (nth i (W a) []) l * at_ (gains a) l)). rewrite (M8 i Hi). fold K. destruct (Nat.eqb_spec (Datatypes.S i) n), (Nat.eqb_spec (pred n) i); try lia; ring. }
  rewrite EK in A.
  assert (Erel : sum n (fun i => K i * lap (edges c) (Y i) j) = ell (comb n K Y)) by (unfold ell; rewrite lap_comb; reflexivity).
  fold K Y. rewrite Erel. assert (CK : 0 <= Q2R (coupling a) * K (pred n)) by (rewrite <- EK; apply WP).
  set (V0 := value a f (y a off (X 0) 0)) in *. set (x := exp (- (Q2R (falls a) * turns a t))) in *. set (e := eta a t) in *.
  assert (Sq : sq (e ^ n * ell (comb n K Y)) = e ^ (2 * n) * sq (ell (comb n K Y))).
  { unfold sq. replace (2 * n)%nat with (n + n)%nat by lia. rewrite pow_add. ring. }
  rewrite Sq. assert (E2 : 0 <= e ^ (2 * n)) by (replace (2 * n)%nat with (n + n)%nat by lia; rewrite pow_add; apply Rle_0_sqr).
  assert (V1 : 0 <= value a f Y).
  { unfold value. fold n. pose proof (worth_self S n w (fun i j => at_ (nth i (P a) []) j) Y PS M7) as WS. unfold double.
    change (sum n (fun i => sum n (fun j => at_ (nth i (P a) []) j * pair (edges (graph a)) (ly f) (Y i) (Y j)))) with
      (sum n (fun i => sum n (fun j => at_ (nth i (P a) []) j * S (Y i) (Y j)))). rewrite WS. apply (psd_ok split n (W a) S _ PS M1). }
  assert (csV : at_ cs j * value a f Y <= at_ cs j * (x * V0)).
  { destruct C0 as [C0|Z]; [apply Rmult_le_compat_l; assumption|].
    assert (ZV : forall u, value a f u = 0).
    { intros u. unfold value, double. apply sum_zero. intros i _. apply sum_zero. intros i' _. unfold pair. fold c. rewrite !Z. field. }
    unfold V0. rewrite !ZV. lra. }
  apply Rle_trans with (e ^ (2 * n) * (Q2R (coupling a) * K (pred n) * (at_ cs j * (x * V0)))).
  - apply Rmult_le_compat_l; [exact E2|]. eapply Rle_trans; [exact A|]. apply Rmult_le_compat_l; assumption.
  - assert (CV0 : 0 <= at_ cs j * V0).
    { assert (0 <= at_ cs j * value a f Y).
      { destruct C0 as [C0|Z]; [apply Rmult_le_pos; assumption|]. unfold value, double. rewrite sum_zero; [lra|].
        intros i _. apply sum_zero. intros i' _. unfold pair. fold c. rewrite !Z. field. }
      pose proof (exp_pos (- (Q2R (falls a) * turns a t))) as X0. fold x in X0. nra. }
    replace (e ^ (2 * n) * (Q2R (coupling a) * K (pred n) * (at_ cs j * (x * V0))))
      with (x * e ^ (2 * n) * (Q2R (coupling a) * K (pred n) * (at_ cs j * V0))) by ring.
    replace (g ^ (2 * n) * (Q2R (coupling a) * K (pred n)) * V0 * at_ cs j)
      with (g ^ (2 * n) * (Q2R (coupling a) * K (pred n) * (at_ cs j * V0))) by ring.
    apply Rmult_le_compat_r; [apply Rmult_le_pos; [exact CK|exact CV0]|exact PW].
Qed.
Lemma minkowski m (u p r : nat -> R) R : (forall i, (i < m)%nat -> Rabs (u i) <= p i + r i /\ 0 <= p i /\ 0 <= r i) ->
  sum m (fun i => sq (r i)) <= R * R -> 0 <= R -> sqrt (sum m (fun i => sq (u i))) <= sum m p + R.
Proof.
  intros H HR R0. set (T := sum m p).
  assert (One : forall g i, (forall j, (j < m)%nat -> 0 <= g j) -> (i < m)%nat -> g i <= sum m g).
  { intros g i G Hi. rewrite <- (sum_at m i g Hi). apply sum_le. intros j Hj. specialize (G j Hj). destruct (i =? j)%nat; lra. }
  assert (T0 : 0 <= T).
  { unfold T. rewrite <- (sum_zero m (fun _ => 0)) by reflexivity. apply sum_le. intros i Hi. apply (H i Hi). }
  rewrite <- (sqrt_square (T + R)) by lra. apply sqrt_le_1_alt.
  apply Rle_trans with (sum m (fun i => (T + 2 * R) * p i + sq (r i))).
  - apply sum_le. intros i Hi. destruct (H i Hi) as [A [P0 R1]].
    assert (p i <= T) by (apply (One p i); [intros; apply H; assumption|exact Hi]).
    assert (r i <= R).
    { apply Rsqr_incr_0; [|assumption|assumption]. unfold Rsqr. eapply Rle_trans; [|exact HR].
      apply (One (fun i => sq (r i)) i); [intros; apply Rle_0_sqr|exact Hi]. }
    apply Rle_trans with (sq (p i + r i)).
    + unfold sq. rewrite <- (Rabs_right (u i * u i)) by (apply Rle_ge; apply Rle_0_sqr). rewrite Rabs_mult.
      apply Rmult_le_compat; try apply Rabs_pos; assumption.
    + unfold sq. assert (p i * p i <= T * p i) by (apply Rmult_le_compat_r; assumption).
      assert (p i * r i <= p i * R) by (apply Rmult_le_compat_l; assumption). lra.
  - rewrite sum_plus, sum_scal. fold T. lra.
Qed.
Lemma sizes_plus m (u v : nat -> R) p q : sum m (fun i => sq (u i)) <= p * p -> sum m (fun i => sq (v i)) <= q * q -> 0 <= p -> 0 <= q ->
  sum m (fun i => sq (u i + v i)) <= (p + q) * (p + q).
Proof.
  intros Hp Hq p0 q0. set (F := fun x z : nat -> R => sum m (fun i => x i * z i)).
  assert (PF : positive F).
  { constructor; intros; unfold F.
    - apply sum_ext. intros. ring.
    - rewrite <- sum_plus. apply sum_ext. intros. ring.
    - rewrite <- sum_scal. apply sum_ext. intros. ring.
    - rewrite <- (sum_zero m (fun _ => 0)) by reflexivity. apply sum_le. intros. apply Rle_0_sqr. }
  pose proof (cauchy F PF u v) as C. change (sum m (fun i => sq (u i))) with (F u u) in Hp. change (sum m (fun i => sq (v i))) with (F v v) in Hq.
  assert (D : F u v <= p * q).
  { apply Rsqr_incr_0_var; [|apply Rmult_le_pos; assumption]. unfold Rsqr. eapply Rle_trans; [exact C|].
    replace (p * q * (p * q)) with (p * p * (q * q)) by ring. apply Rmult_le_compat; [apply (above0 F PF)|apply (above0 F PF)|assumption|assumption]. }
  rewrite (sum_ext m _ (fun i => u i * u i + (2 * (u i * v i) + v i * v i))) by (intros; unfold sq; ring). rewrite !sum_plus, sum_scal.
  change (F u u + (2 * F u v + F v v) <= (p + q) * (p + q)). lra.
Qed.
Lemma pace_ok g t : pace a = Some g -> 0 <= t < deadline c -> exp (- (Q2R (falls a) * turns a t)) * eta a t ^ (2 * n) <= Q2R g ^ (2 * n).
Proof.
  intros Hg Ht. destruct matrices as [_ [_ [M3 [M4 _]]]]. unfold pace in Hg. destruct (Qle_bool _ _) eqn:E.
  - injection Hg as <-. rewrite first_ok. apply (powers a Hprot M4); [|exact Ht]. apply Qle_bool_iff, Qle_Rle in E.
    rewrite index_2, Q2R_mult, pull_ok in E. rewrite mult_INR. exact E.
  - apply (capped a Hprot M4 g (2 * n) _ Hg); [lra|exact Ht].
Qed.
Lemma near_root_ok q : 0 <= Q2R q -> 0 <= Q2R (near_root q) /\ Q2R q <= Q2R (near_root q) * Q2R (near_root q).
Proof.
  intros H. unfold near_root. cbv zeta. set (s := inject_Z _).
  assert (S0 : 0 < Q2R s).
  { unfold s, Q2R. simpl. rewrite Rinv_1, Rmult_1_r. apply IZR_lt. apply Z.pow_pos_nonneg; [reflexivity|apply Z.log2_nonneg]. }
  destruct (Moving.root_ok (q * (s * s))) as [A B]; [rewrite !Q2R_mult; apply Rmult_le_pos; [exact H|apply Rmult_le_pos; lra]|].
  rewrite Q2R_div by (intros Z; apply Qeq_eqR in Z; rewrite Q2R_0 in Z; lra). set (r := Q2R (root _)) in *. split.
  - apply Rmult_le_pos; [exact A|left; apply Rinv_0_lt_compat; exact S0].
  - unfold sq in B. rewrite !Q2R_mult in B. apply (Rmult_le_reg_r (Q2R s * Q2R s)); [apply Rmult_lt_0_compat; exact S0|].
    replace (r / Q2R s * (r / Q2R s) * (Q2R s * Q2R s)) with (r * r) by (field; lra). exact B.
Qed.
Lemma deviating_ok cs v : In (cs, v) (deviating a) -> exists kf f b F m, In kf (used a) /\ nth_error (funcs c) kf = Some f /\
  deviation f = Some (b, cs) /\ Checker.form (order c) (dls d) (dL d) (ly f) = Some (F, m) /\ v = worth_all a F m.
Proof.
  intros H. unfold deviating in H. fold c d in H. apply in_flat_map in H as [kf [Hu Hk]].
  destruct (nth_error (funcs c) kf) as [f|] eqn:Ef; [|destruct Hk].
  destruct (deviation f) as [[b cs']|] eqn:Ed; [|destruct Hk].
  destruct (Checker.form (order c) (dls d) (dL d) (ly f)) as [[F m]|] eqn:EF; [|destruct Hk].
  destruct Hk as [Hk|[]]. injection Hk as <- <-. exists kf, f, b, F, m. repeat split; assumption.
Qed.
(** what feedback of the own state adds *)
Let own_force X t j i := eta a t ^ n * sum n (fun u => at_ (damping a) u * y a (spot a i) (X i t) t u j).
Lemma own_ok own j X Sl t : In own (own_parts a (if forallb (Qeq_bool 0) (damping a) then [] else deviating a) j) ->
  check_begins a = true -> (j < order c)%nat -> begun a X Sl -> 0 <= t < deadline c ->
  0 <= Q2R own /\ sum (length (axes a)) (fun i => sq (own_force X t j i)) <= Q2R own * Q2R own.
Proof.
  intros Hin HB Hj HX Ht. set (m := length (axes a)). unfold own_parts in Hin. destruct (forallb (Qeq_bool 0) (damping a)) eqn:Z.
  { destruct Hin as [<-|[]]. rewrite Q2R_0. split; [lra|]. rewrite sum_zero; [lra|]. intros i _. unfold own_force.
    rewrite sum_zero; [unfold sq; ring|]. intros u _. rewrite (zeros _ u Z). ring. }
  destruct (slows a) eqn:ES; [|destruct Hin]. cbv zeta in Hin. apply in_map_iff in Hin as [[cs V0] [Eown Hin]]. cbn [fst snd] in Eown.
  destruct (deviating_ok cs V0 Hin) as [kf [f [b [F [mm [Hu [Ef [Ed [EF ->]]]]]]]]]. clear Hin.
  destruct matrices as [M1 [M2 [M3 [M4 [M5 [M6 [M7 M8]]]]]]]. destruct (T_k a Hprot) as [T0 K0]. fold c in T0, K0.
  unfold slows in ES. cbv zeta in ES. apply andb_prop in ES as [H H8]. apply andb_prop in H as [H H7]. apply andb_prop in H as [H H6].
  apply andb_prop in H as [H H5]. apply andb_prop in H as [H H4]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  apply Nat.eqb_eq in H1. fold n in H1, H8. assert (EC : cap a = None) by (destruct (cap a); [discriminate|reflexivity]).
  apply Qeq_bool_eq, Qeq_eqR in H3, H4. rewrite Q2R_0 in H3, H4. apply Qpos in H5. apply Qle_bool_iff, Qle_Rle in H6, H8. apply notneg_ok in H7.
  set (f2 := nth 1 (damping a) 0%Q) in *. set (a2 := nth 1 (plant a) 0%Q) in *.
  assert (Eg : Q2R (begin_gain a) = eta a 0) by (rewrite <- first_ok; unfold first_gain; rewrite EC; reflexivity).
  rewrite Q2R_1, Q2R_mult, pull_ok in H6. rewrite Q2R_plus, Q2R_mult, Q2R_minus, inverse_ok, pull_ok, Eg in H7 by (rewrite pull_ok; exact K0).
  rewrite index_2, Q2R_mult, pull_ok in H8. set (g := begin_gain a) in *.
  pose proof (begins_ok f F mm X Sl EF HB HX) as EV. fold m in EV. set (V := sum m (fun i => value a f (y a (spot a i) (X i 0) 0))) in *.
  set (K := at_ cs j * at_ (nth 1 (W a) []) 1 * V). set (r := Q2R (falls a)) in *. set (x := exp (- (r * turns a t))).
  assert (X0 : 0 < x) by apply exp_pos. destruct (gain_slope t Ht) as [E0 E1].
  assert (G0 : 0 < eta a 0) by (apply gain_slope; lra).
  (* deviations *)
  assert (Dev : sum m (fun i => sq (away a (spot a i) (X i t) 1 j)) <= sq (eta a t) * x * K).
  { apply Rle_trans with (sum m (fun i => sq (eta a t) * x * (at_ cs j * at_ (nth 1 (W a) []) 1) * value a f (y a (spot a i) (X i 0) 0)));
      [|rewrite sum_scal; fold V; apply Req_le; unfold K; ring].
    apply sum_le. intros i Hi. destruct (HX _ i (nth_error_nth' (axes a) (Axis [] [] []) Hi)) as [HF _].
    destruct (claim_ok kf f Hu Ef _ _ _ t HF Ht) as [_ C]. specialize (C b cs 1%nat j Ed ltac:(fold n; lia) Hj). cbv zeta in C.
    change (at_ (offsets (nth i (axes a) (Axis [] [] [])))) with (spot a i) in C. eapply Rle_trans; [exact C|].
    apply Req_le. unfold x, r. rewrite pow_1. ring. }
  assert (K1 : 0 <= K).
  { apply Rnot_lt_le. intros N. assert (S0 : 0 <= sum m (fun i => sq (away a (spot a i) (X i t) 1 j))).
    { rewrite <- (sum_zero m (fun _ => 0)) by reflexivity. apply sum_le. intros; apply Rle_0_sqr. }
    assert (0 < sq (eta a t) * x) by (apply Rmult_lt_0_compat; [unfold sq; apply Rmult_lt_0_compat; exact E0|exact X0]). nra. }
  set (kq := (nth j cs 0 * cell (W a) 1 1 * worth_all a F mm)%Q) in *.
  assert (EK : Q2R kq = K) by (unfold kq; rewrite !Q2R_mult, EV; reflexivity).
  destruct (near_root_ok kq) as [R0 R1]; [rewrite EK; exact K1|]. rewrite EK in R1. set (rk := near_root kq) in *.
  (* the common velocity *)
  set (e := fun i => end_state c (placed (spot a i) (X i 0) 1) j). set (vq := qsum _) in Eown.
  assert (Ev : Q2R vq = sum m (fun i => sq (e i))).
  { unfold vq. rewrite (qsum_list _ _ (Axis [] [] [])). apply sum_ext. intros i Hi. rewrite Q2R_mult. fold c. rewrite ends_q_ok by exact Hj.
    unfold sq, e. destruct (HX _ i (nth_error_nth' (axes a) (Axis [] [] []) Hi)) as [_ B0].
    assert (EE : end_state c (at_ (placed_q (nth i (axes a) (Axis [] [] [])) 1)) j = end_state c (placed (spot a i) (X i 0) 1) j).
    { apply (end_ext a Hend M5). intros l Hl. unfold placed, placed_q. cbn [Nat.eqb]. rewrite (B0 1%nat l ltac:(fold n; lia) Hl). ring. }
    rewrite EE. reflexivity. }
  destruct (near_root_ok vq) as [S0 S1].
  { rewrite Ev, <- (sum_zero m (fun _ => 0)) by reflexivity. apply sum_le. intros; apply Rle_0_sqr. }
  set (rv := near_root vq) in *. rewrite Ev in S1.
  assert (Eo : Q2R own = Q2R f2 * eta a 0 * (eta a 0 * Q2R rk) + Q2R f2 * eta a 0 * Q2R rv).
  { rewrite <- Eown, !Q2R_mult, Q2R_plus, Q2R_mult, Eg. ring. }
  assert (P1 : 0 <= Q2R f2 * eta a 0 * (eta a 0 * Q2R rk)) by (apply Rmult_le_pos; apply Rmult_le_pos; lra).
  assert (P2 : 0 <= Q2R f2 * eta a 0 * Q2R rv) by (apply Rmult_le_pos; [apply Rmult_le_pos; lra|exact S0]).
  rewrite Eo. split; [lra|]. set (fd := fades a (Q2R a2) (Q2R f2) t).
  assert (F0 : 0 <= eta a t * fd <= eta a 0).
  { split; [apply Rmult_le_pos; [lra|left; apply exp_pos]|]. apply (fades_fast a (Q2R a2) (Q2R f2) Hprot M4 t); fold c; assumption. }
  apply Rle_trans with (sum m (fun i => sq (Q2R f2 * eta a t * away a (spot a i) (X i t) 1 j + Q2R f2 * (eta a t * fd) * e i))).
  - apply Req_le. apply sum_ext. intros i Hi. f_equal. unfold own_force. rewrite H1. unfold sum. cbn [seq fold_right].
    change (at_ (damping a) 0) with (Q2R (nth 0 (damping a) 0%Q)). rewrite <- H4. change (at_ (damping a) 1) with (Q2R f2).
    destruct (HX _ i (nth_error_nth' (axes a) (Axis [] [] []) Hi)) as [HF _].
    pose proof (velocity a (spot a i) (X i) (Sl i) Hedges Hend Hprot M4 HF ltac:(exact H1) (eq_sym H3) (eq_sym H4) j t Ht) as VE. cbv beta zeta in VE.
    rewrite (Rmax_right 0 t), (Rmax_right 0 0) in VE by lra. change (fades a (at_ (plant a) 1) (at_ (damping a) 1) t) with fd in VE.
    assert (AE : away a (spot a i) (X i t) 1 j = placed (spot a i) (X i t) 1 j - fd * e i) by (unfold away; rewrite VE; reflexivity).
    rewrite AE. unfold y. field. lra.
  - apply sizes_plus; [| |exact P1|exact P2].
    + rewrite (sum_ext m _ (fun i => sq (Q2R f2 * eta a t) * sq (away a (spot a i) (X i t) 1 j))) by (intros; unfold sq; ring). rewrite sum_scal.
      pose proof (powers a Hprot M4 4 r ltac:(rewrite H1 in H8; simpl INR in *; fold c; lra) t Ht) as PW. fold x in PW.
      apply Rle_trans with (sq (Q2R f2 * eta a t) * (sq (eta a t) * x * K)); [apply Rmult_le_compat_l; [apply Rle_0_sqr|exact Dev]|].
      replace (sq (Q2R f2 * eta a t) * (sq (eta a t) * x * K)) with (sq (Q2R f2) * (x * eta a t ^ 4) * K) by (unfold sq; ring).
      replace (Q2R f2 * eta a 0 * (eta a 0 * Q2R rk) * (Q2R f2 * eta a 0 * (eta a 0 * Q2R rk))) with (sq (Q2R f2) * eta a 0 ^ 4 * (Q2R rk * Q2R rk)) by (unfold sq; ring).
      assert (Q0 : 0 <= sq (Q2R f2)) by apply Rle_0_sqr. assert (PE : 0 <= eta a 0 ^ 4) by (apply pow_le; lra).
      apply Rmult_le_compat; [apply Rmult_le_pos; [exact Q0|apply Rmult_le_pos; [lra|apply pow_le; lra]]|exact K1| |exact R1].
      apply Rmult_le_compat_l; assumption.
    + rewrite (sum_ext m _ (fun i => sq (Q2R f2 * (eta a t * fd)) * sq (e i))) by (intros; unfold sq; ring). rewrite sum_scal.
      assert (Le : sq (Q2R f2 * (eta a t * fd)) <= sq (Q2R f2 * eta a 0)).
      { assert (0 <= Q2R f2 * (eta a t * fd) <= Q2R f2 * eta a 0) by (split; [apply Rmult_le_pos; lra|apply Rmult_le_compat_l; lra]).
        unfold sq. apply Rmult_le_compat; lra. }
      replace (Q2R f2 * eta a 0 * Q2R rv * (Q2R f2 * eta a 0 * Q2R rv)) with (sq (Q2R f2 * eta a 0) * (Q2R rv * Q2R rv)) by (unfold sq; ring).
      apply Rmult_le_compat; [apply Rle_0_sqr| |exact Le|exact S1]. rewrite <- Ev. rewrite Ev, <- (sum_zero m (fun _ => 0)) by reflexivity.
      apply sum_le. intros; apply Rle_0_sqr.
Qed.
Theorem tops_ok : tops_claim a.
Proof.
  intros Ne X Sl t j Hj HX Ht. set (m := length (axes a)). fold c in Hj, Ht. unfold check_tops in Htops. destruct (tops a) as [|q0 l0] eqn:Et; [contradiction|].
  destruct (pace a) as [g|] eqn:Eg; [|discriminate].
  set (l := q0 :: l0) in *. cbv zeta in Htops. fold c n d in Htops.
  apply andb_prop in Htops as [H H7]. apply andb_prop in H as [H H5]. apply andb_prop in H as [H3 H4].
  rewrite forallb_forall in H7. specialize (H7 j ltac:(apply in_seq; lia)). apply existsb_exists in H7 as [own [Ho H7]].
  apply andb_prop in H7 as [R0 H7].
  set (added := match kind c with Nominal _ => 0%Q | SlidingMode _ _ mu1 _ _ _ => (mu1 * index (length (axes a)))%Q end) in *.
  assert (EA : Q2R added = match kind c with Nominal _ => 0 | SlidingMode _ _ mu1 _ _ _ => Q2R mu1 * INR m end).
  { unfold added. destruct (kind c); [apply Q2R_0|]. rewrite Q2R_mult, index_ok. reflexivity. }
  fold c. rewrite <- EA. set (rest := (nth j l 0 - added - _ - own)%Q) in *.
  apply existsb_exists in H7 as [[cs B] [Hk HB]]. cbn [fst snd] in HB. apply in_flat_map in Hk as [kf [Hu Hk]].
  destruct (nth_error (funcs c) kf) as [f|] eqn:Ef; [|destruct Hk].
  destruct (bounds_of c d f) as [[[v cs'] cn]|] eqn:EB; [|destruct Hk].
  destruct (Checker.form (order c) (dls d) (dL d) (ly f)) as [[F mm]|] eqn:EF; [|destruct Hk].
  destruct Hk as [Hk|[]]. injection Hk as <- EBq. apply Qle_bool_iff, Qle_Rle in HB. rewrite <- EBq in HB. clear EBq.
  rewrite !Q2R_mult, reduced_ok, !Q2R_mult, powq_ok, (begins_ok f F mm X Sl EF H5 HX) in HB. fold m in HB.
  apply Qle_bool_iff, Qle_Rle in R0. rewrite Q2R_0 in R0. destruct (own_ok own j X Sl t Ho H5 Hj HX Ht) as [O0 O1]. fold m in O1.
  assert (Er : Q2R rest = at_ l j - Q2R added - sum m (fun i => Rabs (at_ (plant a) 0 * spot a i j)) - Q2R own).
  { unfold rest. rewrite !Q2R_minus. f_equal. f_equal. rewrite (qsum_list _ _ (Axis [] [] [])). apply sum_ext. intros i _.
    rewrite abs_ok, Q2R_mult. reflexivity. }
  set (rel := fun i => eta a t ^ n * sum n (fun u => at_ (gains a) u * lap (edges c) (y a (spot a i) (X i t) t u) j)).
  assert (Abs : forall v : R, sq (Rabs v) = sq v) by (intros u; unfold sq; rewrite <- Rabs_mult; apply Rabs_right; apply Rle_ge; apply Rle_0_sqr).
  assert (MK : over_space a (fun i => control a (spot a i) (X i t) t j) <= sum m (fun i => Rabs (at_ (plant a) 0 * spot a i j)) + (Q2R rest + Q2R own)).
  { apply (minkowski m _ _ (fun i => Rabs (rel i) + Rabs (own_force X t j i))); [| |lra].
    - intros i Hi. split; [|split; [apply Rabs_pos|apply Rplus_le_le_0_compat; apply Rabs_pos]]. unfold control. fold n c. rewrite sum_plus.
      replace (_ - _) with (at_ (plant a) 0 * spot a i j + - (rel i + own_force X t j i)) by (unfold rel, own_force; ring).
      eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_Ropp. apply Rplus_le_compat_l. apply Rabs_triang.
    - apply sizes_plus; [|rewrite (sum_ext m _ (fun i => sq (own_force X t j i))) by (intros; apply Abs); exact O1|exact R0|exact O0].
      eapply Rle_trans; [|exact HB]. set (CK := Q2R (coupling a) * _).
      apply Rle_trans with (sum m (fun i => at_ cs' j * (Q2R g ^ (2 * n) * CK) * value a f (y a (spot a i) (X i 0) 0)));
        [|rewrite sum_scal; change (Q2R (nth j cs' 0%Q)) with (at_ cs' j); apply Req_le; change (n + (n + 0))%nat with (2 * n)%nat; generalize (Q2R g ^ (2 * n)); intros; ring].
      apply sum_le. intros i Hi. destruct (HX _ i (nth_error_nth' (axes a) (Axis [] [] []) Hi)) as [HF _]. rewrite Abs.
      eapply Rle_trans; [apply (relative_ok kf f F mm v cs' cn (spot a i) (X i) (Sl i) t j Hu Ef EB EF H3 H4 HF Ht Hj (Q2R g) (pace_ok g t Eg Ht))|].
      apply Req_le. change (Q2R (coupling a) * at_ (gains a) (pred n)) with CK. generalize (Q2R g ^ (2 * n)). intros. ring. }
  rewrite Er in MK. lra.
Qed.

(** * What is left under a cap *)
Lemma floor_pos q : 0 <= Q2R q -> 0 <= Q2R (floor q).
Proof.
  intros H. rewrite <- Q2R_0 in H. apply Rle_Qle in H. unfold Qle in H. simpl in H. rewrite Z.mul_1_r in H. rewrite <- Q2R_0. apply Qle_Rle.
  unfold floor. cbv zeta. apply Qle_shift_div_l; [reflexivity|]. rewrite Qmult_0_l. change 0%Q with (inject_Z 0). rewrite <- Zle_Qle.
  apply Z.div_pos; [apply Z.mul_nonneg_nonneg; [exact H|discriminate]|reflexivity].
Qed.
Hypothesis Hleft : check_left a = true.
Lemma cap_reached G : cap a = Some G -> let w := if Qle_bool G (begin_gain a) then span c else (pull_in a / (G - slope a))%Q in
  0 < Q2R w <= deadline c /\ forall t, deadline c - Q2R w <= t < deadline c ->
    turns a t = clock (deadline c) (Q2R (slope a)) (k c) (deadline c - Q2R w) + Q2R G * (t - (deadline c - Q2R w)).
Proof.
  intros EG w. destruct (T_k a Hprot) as [A B]. fold c in A, B. destruct matrices as [_ [_ [_ [M4 _]]]]. pose proof (proj1 M4) as R0.
  set (T := deadline c) in *. pose proof begin_ok as BO. assert (U0 : uncapped a 0 = Q2R (slope a) + k c / T) by (unfold uncapped, gain; fold c T; rewrite Rminus_0_r; reflexivity).
  assert (KT : 0 < k c / T) by (apply Rdiv_lt_0_compat; lra).
  assert (Up : forall t u, t <= u < T -> uncapped a t <= uncapped a u).
  { intros t u H. unfold uncapped, gain. fold c T. apply Rplus_le_compat_l. unfold Rdiv. apply Rmult_le_compat_l; [lra|]. apply Rinv_le_contravar; lra. }
  destruct (Qle_bool G (begin_gain a)) eqn:E.
  - apply Qle_bool_iff, Qle_Rle in E. assert (Ew : Q2R w = T) by apply span_ok. rewrite Ew. split; [lra|]. intros t Ht.
    apply (turns_late a Hprot G (T - T) t EG ltac:(lra) ltac:(apply Ht)).
    + intros u Hu. lra.
    + intros u Hu. specialize (Up 0 u ltac:(fold c T in Hu; lra)). lra.
  - assert (L : Q2R (begin_gain a) < Q2R G).
    { destruct (Qlt_le_dec (begin_gain a) G) as [L|L]; [apply Qlt_Rlt; exact L|apply Qle_bool_iff in L; congruence]. }
    rewrite BO, U0 in L. assert (P : 0 < Q2R (G - slope a)) by (rewrite Q2R_minus; lra).
    assert (Ew : Q2R w = k c / (Q2R G - Q2R (slope a))).
    { unfold w. rewrite Q2R_div, pull_ok, Q2R_minus; [reflexivity|]. intros Z. apply Qeq_eqR in Z. rewrite Z, Q2R_0 in P. lra. }
    rewrite Q2R_minus in P. assert (W0 : 0 < Q2R w) by (rewrite Ew; apply Rdiv_lt_0_compat; lra).
    assert (W1 : Q2R w * (Q2R G - Q2R (slope a)) = k c) by (rewrite Ew; field; lra).
    assert (W2 : Q2R w <= T).
    { apply (Rmult_le_reg_r (Q2R G - Q2R (slope a))); [exact P|]. rewrite W1. apply Rle_trans with (T * (k c / T)); [right; field; lra|].
      apply Rmult_le_compat_l; lra. }
    assert (AtG : uncapped a (T - Q2R w) = Q2R G).
    { unfold uncapped, gain. fold c T. replace (T - (T - Q2R w)) with (Q2R w) by ring. rewrite <- W1. field. lra. }
    split; [lra|]. intros t Ht. apply (turns_late a Hprot G _ t EG); [lra|apply Ht| |].
    + intros u Hu. rewrite <- AtG. apply Up. lra.
    + intros u Hu. rewrite <- AtG. apply Up. fold c T in Hu. lra.
Qed.
Lemma near_end w (Q : R -> Prop) : 0 < w -> (forall t, deadline c - w < t < deadline c -> Q t) -> at_left (deadline c) Q.
Proof.
  intros W0 H. exists (mkposreal _ W0). intros t Bt Lt. unfold ball in Bt; simpl in Bt; unfold AbsRing_ball, abs, minus, plus, opp in Bt; simpl in Bt.
  apply Rabs_def2 in Bt. apply H. lra.
Qed.
Theorem left_ok : left_claim a.
Proof.
  intros q rows e EL He nearly. unfold check_left in Hleft. rewrite EL in Hleft. destruct (cap a) as [G|] eqn:EG; [|discriminate].
  cbv zeta in Hleft. fold c n d in Hleft. set (w := if Qle_bool G (begin_gain a) then span c else (pull_in a / (G - slope a))%Q) in *.
  set (y0 := reduced ((q - slope a * (span c - w) - G * w) / pull_in a)) in *. set (y1 := if notneg y0 then y0 else 0%Q) in *.
  set (b := twice_4 (floor _)) in *.
  apply andb_prop in Hleft as [H H5]. apply andb_prop in H as [H H4]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  destruct (T_k a Hprot) as [A B]. fold c in A, B. destruct matrices as [M1 [_ [M3 [M4 _]]]]. pose proof (proj2 M4 G EG) as G0.
  set (T := deadline c) in *. destruct (cap_reached G EG) as [W0 TL]. fold w T in W0, TL. apply notneg_ok in H1.
  assert (Far : Q2R q <= clock T (Q2R (slope a)) (k c) (T - Q2R w) + Q2R G * Q2R w).
  { assert (Y0 : 0 <= Q2R y1) by (unfold y1; destruct (notneg y0) eqn:N; [apply notneg_ok; exact N|rewrite Q2R_0; lra]).
    assert (Y1 : Q2R y0 <= Q2R y1).
    { unfold y1. destruct (notneg y0) eqn:N; [lra|]. rewrite Q2R_0. unfold notneg in N. apply Z.leb_gt in N. unfold Q2R.
      apply IZR_lt in N. assert (0 < / IZR (Zpos (Qden y0))) by (apply Rinv_0_lt_compat; apply IZR_lt; reflexivity). nra. }
    apply negb_true_iff in H2. pose proof (Moving.power_ok y1 Y0 H2) as PO. apply Qle_bool_iff, Qle_Rle in H3.
    assert (Nw : ~ (w == 0)%Q) by (intros Z; apply Qeq_eqR in Z; rewrite Z, Q2R_0 in W0; lra).
    rewrite Q2R_div, span_ok in H3 by exact Nw. fold T in H3.
    assert (LN : Q2R y1 <= ln (T / Q2R w)).
    { rewrite <- (ln_exp (Q2R y1)). destruct (Req_dec (exp (Q2R y1)) (T / Q2R w)) as [Z|Z]; [rewrite Z; lra|]. left.
      apply ln_increasing; [apply exp_pos|lra]. }
    assert (Np : ~ (pull_in a == 0)%Q) by (intros Z; apply Qeq_eqR in Z; rewrite pull_ok, Q2R_0 in Z; lra).
    unfold y0 in Y1. rewrite reduced_ok, Q2R_div, !Q2R_minus, !Q2R_mult, Q2R_minus, span_ok, pull_ok in Y1 by exact Np. fold T in Y1.
    unfold clock. replace (T - (T - Q2R w)) with (Q2R w) by ring. set (ll := ln (T / Q2R w)) in *.
    assert (E : (Q2R q - Q2R (slope a) * (T - Q2R w) - Q2R G * Q2R w) / k c * k c = Q2R q - Q2R (slope a) * (T - Q2R w) - Q2R G * Q2R w) by (field; lra).
    set (z := (Q2R q - _ - _) / k c) in *. assert (z * k c <= ll * k c) by (apply Rmult_le_compat_r; lra). lra. }
  assert (Clock : forall r, 0 < r -> at_left T (fun t => Q2R q - r <= turns a t)).
  { intros r Hr. assert (M : 0 < Rmin (r / Q2R G) (Q2R w)) by (apply Rmin_pos; [apply Rdiv_lt_0_compat; assumption|lra]).
    apply (near_end _ _ M). fold T. intros t Ht. pose proof (Rmin_l (r / Q2R G) (Q2R w)). pose proof (Rmin_r (r / Q2R G) (Q2R w)).
    rewrite TL by lra. assert (X : Q2R G * (T - t) <= Q2R G * (r / Q2R G)) by (apply Rmult_le_compat_l; lra).
    replace (Q2R G * (r / Q2R G)) with r in X by (field; lra). lra. }
  split; [apply Clock; exact He|]. intros X Sl i j Hi Hj HX. unfold nearly. fold c T in Hj |- *. fold n in Hi.
  rewrite forallb_forall in H5. specialize (H5 j ltac:(apply in_seq; lia)). rewrite forallb_forall in H5.
  specialize (H5 i ltac:(apply in_seq; lia)). set (x := nth i (nth j rows []) 0%Q) in *. apply andb_prop in H5 as [X0 H5]. apply notneg_ok in X0.
  apply existsb_exists in H5 as [[cs' V0] [Hk HB]]. cbn [fst snd] in HB.
  destruct (deviating_ok cs' V0 Hk) as [kf [f [bb [F [mm [Hu [Ef [Ed [EF ->]]]]]]]]]. apply Qle_bool_iff, Qle_Rle in HB.
  rewrite !Q2R_mult, powq_ok, (begins_ok f F mm X Sl EF H4 HX) in HB. set (m := length (axes a)) in *.
  set (V := sum m (fun i => value a f (y a (spot a i) (X i 0) 0))) in *. set (K := at_ cs' j * at_ (nth i (W a) []) i * V).
  assert (EK : Q2R (nth j cs' 0%Q) * Q2R (cell (W a) i i) * V = K) by reflexivity. rewrite EK in HB. clear EK.
  set (r := Q2R (falls a)) in *.
  assert (Hb : Q2R b <= exp (r * Q2R q)).
  { set (p := reduced (falls a * q / 16)) in *. assert (Ep : Q2R p = r * Q2R q / 16).
    { unfold p. rewrite reduced_ok, Q2R_div by (intros Z; discriminate Z). rewrite Q2R_mult. f_equal. unfold Q2R. simpl. field. }
    assert (P0 : 0 <= Q2R p) by (rewrite Ep; unfold Rdiv; apply Rmult_le_pos; [apply Rmult_le_pos; lra|lra]).
    destruct (Effort.horner_ok p 100 P0) as [N1 N2]. apply Moving.power_below; [apply floor_pos; lra|rewrite <- Ep; exact N2]. }
  assert (Small : forall t, 0 <= t < T -> sum m (fun i0 => sq (away a (spot a i0) (X i0 t) i j)) <= Q2R x * Q2R x * exp (r * (Q2R q - turns a t))).
  { intros t Ht. set (u := exp (- (r * turns a t))).
    assert (S1 : sum m (fun i0 => sq (away a (spot a i0) (X i0 t) i j)) <= sq (eta a t ^ i) * u * K).
    { apply Rle_trans with (sum m (fun i0 => sq (eta a t ^ i) * u * (at_ cs' j * at_ (nth i (W a) []) i) * value a f (y a (spot a i0) (X i0 0) 0)));
        [|rewrite sum_scal; fold V; apply Req_le; unfold K; ring].
      apply sum_le. intros i0 Hi0. destruct (HX _ i0 (nth_error_nth' (axes a) (Axis [] [] []) Hi0)) as [HF _].
      destruct (claim_ok kf f Hu Ef _ _ _ t HF Ht) as [_ C]. specialize (C bb cs' i j Ed Hi Hj). cbv zeta in C. change (at_ (offsets (nth i0 (axes a) (Axis [] [] [])))) with (spot a i0) in C.
      eapply Rle_trans; [exact C|]. apply Req_le. unfold u, r. ring. }
    assert (U0 : 0 < u) by apply exp_pos. eapply Rle_trans; [exact S1|].
    assert (EX : exp (r * (Q2R q - turns a t)) = exp (r * Q2R q) * u) by (unfold u; rewrite <- exp_plus; f_equal; ring).
    assert (PG : sq (eta a t ^ i) <= Q2R G ^ (2 * i)).
    { replace (2 * i)%nat with (i + i)%nat by lia. rewrite pow_add. pose proof (eta_pos a Hprot M4 t (proj2 Ht)).
      assert (eta a t <= Q2R G) by (unfold eta; rewrite EG; apply Rmin_r).
      assert (0 <= eta a t ^ i <= Q2R G ^ i) by (split; [apply pow_le; lra|apply pow_incr; lra]). unfold sq. apply Rmult_le_compat; lra. }
    pose proof (Rle_0_sqr (eta a t ^ i)) as E0. fold (sq (eta a t ^ i)) in E0. change (Rsqr (eta a t ^ i)) with (sq (eta a t ^ i)) in E0.
    rewrite EX. destruct (Rle_lt_dec 0 K) as [K0|K0].
    - apply Rle_trans with (Q2R G ^ (2 * i) * K * u); [|].
      + replace (sq (eta a t ^ i) * u * K) with (sq (eta a t ^ i) * K * u) by ring. apply Rmult_le_compat_r; [lra|]. apply Rmult_le_compat_r; assumption.
      + rewrite <- Rmult_assoc. apply Rmult_le_compat_r; [lra|]. eapply Rle_trans; [exact HB|]. apply Rmult_le_compat_l; [apply Rmult_le_pos; exact X0|exact Hb].
    - apply Rle_trans with 0; [|apply Rmult_le_pos; [apply Rmult_le_pos; exact X0|apply Rmult_le_pos; left; [apply exp_pos|exact U0]]].
      assert (0 <= sq (eta a t ^ i) * u) by (apply Rmult_le_pos; lra). nra. }
  assert (Fin : exists dd, 0 < dd /\ Q2R x * Q2R x * exp (r * dd) <= (Q2R x + e) * (Q2R x + e)).
  { destruct (Req_dec (Q2R x) 0) as [Z|Z]; [exists 1; split; [lra|]; rewrite Z, !Rmult_0_l; nra|].
    set (v := (Q2R x + e) / Q2R x). assert (V1 : 1 < v) by (unfold v; apply (Rmult_lt_reg_r (Q2R x)); [lra|]; unfold Rdiv; rewrite Rmult_assoc, Rinv_l by lra; lra).
    exists (ln v / r). split; [apply Rdiv_lt_0_compat; [rewrite <- ln_1; apply ln_increasing; lra|exact M3]|].
    replace (r * (ln v / r)) with (ln v) by (field; change (0 < r) in M3; lra). rewrite exp_ln by lra.
    replace (Q2R x * Q2R x * v) with (Q2R x * (Q2R x + e)) by (unfold v; field; lra). nra. }
  destruct Fin as [dd [D0 D1]]. generalize (filter_and (F := at_left T) _ _ (Clock dd D0) (near_end T _ A (fun t H => H))).
  apply (filter_imp (F := at_left T)). intros t [C1 C2]. fold T in C2. change (at_ (nth j rows []) i) with (Q2R x).
  unfold over_space. fold m. rewrite <- (sqrt_square (Q2R x + e)) by lra. apply sqrt_le_1_alt. eapply Rle_trans; [apply Small; lra|].
  eapply Rle_trans; [|exact D1]. apply Rmult_le_compat_l; [apply Rmult_le_pos; exact X0|].
  destruct (Req_dec (r * (Q2R q - turns a t)) (r * dd)) as [Z|Z]; [rewrite Z; lra|]. left. apply exp_increasing.
  assert (r * (Q2R q - turns a t) <= r * dd) by (apply Rmult_le_compat_l; [left; exact M3|lra]). lra.
Qed.
End Sound.

Theorem accepts_agents_sound h split points a : accepts_agents h split points a = true -> true_agents a.
Proof.
  intros H. unfold accepts_agents in H. apply andb_prop in H as [H HA]. apply andb_prop in H as [HG HE].
  apply negb_true_iff in HE. split; [apply (accepts_sound h); exact HG|]. unfold accepts in HG. rewrite HE in HG.
  unfold check in HG. set (d := prepare (graph a)) in *.
  repeat match type of HG with (_ && _ = true) => let K := fresh "G" in apply andb_prop in HG as [HG K] end.
  unfold check_agents_only in HA. apply andb_prop in HA as [HA A8]. apply andb_prop in HA as [HA A7]. apply andb_prop in HA as [HA A6].
  apply andb_prop in HA as [HA A5].
  apply andb_prop in HA as [HA A4]. apply andb_prop in HA as [HA A3]. apply andb_prop in HA as [A1 A2].
  split; [apply (definite_ok split); assumption|]. split; [apply (agreement_ok split points a); assumption|].
  split; [apply (ends_ok a); assumption|]. split; [apply (tops_ok split points a); assumption|].
  split; [apply (left_ok split points a); assumption|]. split.
  { intros h0 x0. destruct (matrices split a A1) as [_ [_ [_ [Hs [Hn _]]]]]. apply flight; assumption. }
  intros j Hj.
  assert (E : exists f, nth_error (funcs (graph a)) j = Some f).
  { unfold check_coupling in A3. rewrite forallb_forall in A3. specialize (A3 j Hj).
    destruct (nth_error (funcs (graph a)) j) as [f|]; [exists f; reflexivity|discriminate]. }
  destruct E as [f E]. exists f. split; [exact E|]. apply (claim_ok split points a) with (j := j); assumption.
Qed.
