(** The theorem of the cascade: what the check accepts is true. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz FunctionalExtensionality.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Slide Main Weighted Large AgentCertificate AgentForms AgentCheck
  AgentMotion AgentEnd AgentRest Agents CascadeCertificate CascadeCheck CascadeMotion CascadeExist CascadeEnd CascadeInput.
Open Scope R_scope.

Definition accepts_cascade (h : hints) (p : thrusts) (c : cascade) : bool := accepts h (graph (team c)) && negb (enclosed (graph (team c))) &&
  check_law c && check_agreed c && check_stops c && check_roots c && check_ends_of (team c) && check_push c p.

Section Sound.
Variable c : cascade.
Let a := team c.
Let G := graph a.
Let N := order G.
Let T := deadline G.
Let d := prepare G.
Hypothesis Hedges : check_edges G (dls d) = true.
Hypothesis Hprot : check_protocol G = true.
Hypothesis Hend : check_end G d = true.
Hypothesis Hfuncs : forallb (check_function G d) (funcs G) = true.
Hypothesis Hlaw : check_law c = true.
Let Hls : good (dls d) (map wt (edges G)) = true := Main.Hls G Hedges.

Lemma law_ok : degree a = 2%nat /\ cap a = None /\ positive_gain a /\ 0 < alpha c.
Proof.
  unfold check_law in Hlaw. cbv zeta in Hlaw. fold a G in Hlaw. apply andb_prop in Hlaw as [H _]. apply andb_prop in H as [H _].
  apply andb_prop in H as [H H4]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  assert (EC : cap a = None) by (destruct (cap a); [discriminate|reflexivity]).
  split; [apply Nat.eqb_eq; exact H1|]. split; [exact EC|]. split; [|apply Qpos; exact H4].
  split; [apply notneg_ok; exact H3|]. intros g E. congruence.
Qed.
Let Hcap : cap a = None := proj1 (proj2 law_ok).
Let Hgain : positive_gain a := proj1 (proj2 (proj2 law_ok)).
Let Ha : 0 < alpha c := proj2 (proj2 (proj2 law_ok)).
Lemma inside_graph e : In e (edges G) -> (tgt e < N)%nat /\ (src e < N)%nat.
Proof.
  intros He. pose proof Hedges as H. unfold check_edges in H. apply andb_prop in H as [_ H]. rewrite forallb_forall in H. specialize (H e He).
  apply andb_prop in H as [H _]. apply andb_prop in H as [H _]. apply andb_prop in H as [H1 H2]. split; apply Nat.ltb_lt; [exact H1|exact H2].
Qed.
Lemma function_ok f : In f (funcs G) -> exists F m, Checker.form N (dls d) (dL d) (ly f) = Some (F, m) /\
  nonneg N (dsw d) (dfw d) (rate_form (dls d) (dL d) F (rate f)) = true /\ check_ends G d f = true /\ check_constants G d f = true /\
  match deviation f with Some dev => check_deviation G d F m dev | None => true end = true.
Proof.
  intros Hf. rewrite forallb_forall in Hfuncs. specialize (Hfuncs f Hf). unfold check_function in Hfuncs. fold N in Hfuncs.
  destruct (Checker.form N (dls d) (dL d) (ly f)) as [[F m]|] eqn:EF; [|discriminate].
  apply andb_prop in Hfuncs as [H H4]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  exists F, m. split; [reflexivity|]. split; [exact H1|]. split; [exact H2|]. split; [exact H3|exact H4].
Qed.
Lemma used_ok k : In k (used a) -> exists f, nth_error (funcs G) k = Some f /\ 0 < Q2R (rate f).
Proof.
  intros Hk. pose proof Hlaw as HL. unfold check_law in HL. cbv zeta in HL. fold a G in HL. apply andb_prop in HL as [H _]. apply andb_prop in H as [_ H].
  rewrite forallb_forall in H. specialize (H k Hk). destruct (nth_error (funcs G) k) as [f|]; [|discriminate]. exists f. split; [reflexivity|apply Qpos; exact H].
Qed.
Lemma course_ok f : In f (funcs G) -> course_claim c f.
Proof.
  intros Hf m h X Sl t HX Ht b s. destruct (function_ok f Hf) as [F [mm [EF [H1 [H2 [H3 H4]]]]]]. fold G T in Ht. split; [|split].
  - intros i j Hi Hj. pose proof (lags_die c (h i) (X i) (Sl i) Hprot Hgain Hcap inside_graph (HX i Hi) t j Ht Hj) as L.
    rewrite !lags_at in L by lra. exact L.
  - apply (course c f F mm Hprot Hgain Hcap inside_graph Hls EF H2 H1 m h X Sl t HX Ht).
  - intros q cs x j Ed Hj. rewrite Ed in H4. destruct (deviation_ok G Hedges Hend f F mm EF q cs H4 x) as [_ K]. apply (K j Hj).
Qed.

(** * At the deadline *)
Hypothesis Hagreed : check_agreed c = true.
Hypothesis Hstops : check_stops c = true.
Lemma uses_ok p : uses c p = true -> exists f, In f (funcs G) /\ 0 < Q2R (rate f) /\ p f = true.
Proof.
  intros H. unfold uses in H. cbv zeta in H. fold a G in H. apply existsb_exists in H as [k [Hk H]]. destruct (used_ok k Hk) as [f [Ef Hr]].
  rewrite Ef in H. exists f. split; [apply (nth_error_In _ _ Ef)|]. split; assumption.
Qed.
Lemma rest_inside M : drift a = Some M -> exists m, filterlim (glide a 0 (alpha c)) (at_left T) (locally m) /\ inside a (rest_drift m).
Proof.
  intros EM. pose proof Hlaw as HC. unfold check_law in HC. cbv zeta in HC. fold a G in HC. apply andb_prop in HC as [_ HC].
  rewrite EM in HC. apply andb_prop in HC as [HC HP]. apply Qeq_bool_eq, Qeq_eqR in HP. rewrite Q2R_0 in HP.
  destruct (Agents.rest_inside a Hprot M Hgain EM HC) as [_ [_ [_ [_ [_ [m [L I]]]]]]]. exists m. split; [|exact I].
  change (at_ (plant a) 1) with (Q2R (nth 1 (plant a) 0%Q)) in L. rewrite <- HP in L. exact L.
Qed.
Lemma agree_ok h X Sl j : tracks c h X Sl -> (j < N)%nat -> agree a = true -> filterlim (fun t => away a h (X t) 0 j) (at_left T) (locally 0).
Proof.
  intros HX Hj HA. unfold check_agreed in Hagreed. fold a in Hagreed. rewrite HA in Hagreed. simpl in Hagreed.
  destruct (uses_ok _ Hagreed) as [f [Hf [Hr Hd]]]. destruct (deviation f) as [[q cs]|] eqn:Ed; [|discriminate].
  destruct (function_ok f Hf) as [F [mm [EF [H1 [H2 [H3 H4]]]]]]. rewrite Ed in H4.
  assert (K : forall x, 0 <= Q2R (nth j cs 0%Q) /\ sq (x j - end_state G x j) <= Q2R (nth j cs 0%Q) * V (edges G) (ly f) x).
  { intros x. destruct (deviation_ok G Hedges Hend f F mm EF q cs H4 x) as [_ K]. apply (K j Hj). }
  apply (agrees c f F mm Hprot Hgain Hcap inside_graph Hls EF H2 H1 Ha h X Sl HX q cs j); [lra|apply (K (fun _ => 0))|apply K|exact Ed].
Qed.
Lemma stops_ok h X Sl j : tracks c h X Sl -> (j < N)%nat -> stops c = true -> filterlim (fun t => X t 1%nat j) (at_left T) (locally 0).
Proof.
  intros HX Hj HS. unfold check_stops in Hstops. rewrite HS in Hstops. simpl in Hstops. fold a G in Hstops.
  destruct (uses_ok _ Hstops) as [f [Hf [Hr Hd]]]. apply andb_prop in Hd as [Hk Ht].
  destruct (function_ok f Hf) as [F [mm [EF [H1 [H2 [H3 H4]]]]]]. destruct (T_k a Hprot) as [T0 K0]. fold G in K0.
  destruct (Input.ends_ok G f H2) as [L0 [L1 _]]. destruct (Input.coords_ok G Hls (fun e He => proj2 (inside_graph e He)) f Ht) as [B [B0 HB]].
  apply negb_true_iff in Hk. destruct (Qlt_le_dec 2 (rate f * pull_in a)) as [L|L]; [|apply Qle_bool_iff in L; fold a in Hk; congruence].
  apply Qlt_Rlt in L. rewrite Q2R_mult, pull_ok in L. fold G in L. replace (Q2R 2) with 2 in L by (unfold Q2R; simpl; lra).
  apply (stopped c f F mm Hprot Hgain Hcap inside_graph Hls EF H2 H1 Ha h X Sl HX j (B / Q2R (lowest f))).
  - apply Rmult_le_pos; [exact B0|left; apply Rinv_0_lt_compat; exact L0].
  - intros x. specialize (HB x j Hj). specialize (L1 x). fold G in L1. eapply Rle_trans; [exact HB|]. unfold Rdiv. rewrite Rmult_assoc.
    apply Rmult_le_compat_l; [exact B0|]. apply (Rmult_le_reg_l (Q2R (lowest f))); [exact L0|]. rewrite <- Rmult_assoc, Rinv_r by lra. rewrite Rmult_1_l. exact L1.
  - fold G. apply (Rmult_lt_reg_r (k G)); [exact K0|]. rewrite Rinv_l by lra. lra.
  - exact Hj.
Qed.
Lemma landing_ok : landing c.
Proof.
  unfold landing. cbv zeta. fold a G T. pose proof (proj1 law_ok) as C1.
  destruct (drift a) as [M|] eqn:EM.
  - destruct (rest_inside M EM) as [m [L I]]. exists (rest_drift m). split; [exact I|]. intros h X Sl j HX Hj.
    split; [intros; apply (agree_ok h X Sl); assumption|]. split; [|intros; apply (stops_ok h X Sl); assumption]. intros _.
    destruct (T_k a Hprot) as [T0 _]. unfold outcome. rewrite C1. unfold sum. cbn [seq fold_right rest_drift Nat.eqb]. fold G.
    set (v0 := end_state G (placed h (X 0) 0) j). set (v1 := end_state G (placed h (X 0) 1) j).
    replace (h j + (1 * v0 + (m * v1 + 0))) with (h j + (v0 + m * v1)) by ring.
    apply (filterlim_ext_loc (fun t => h j + (v0 + glide a 0 (alpha c) t * v1))).
    + exists (mkposreal _ T0). intros t Bt Lt. unfold ball in Bt; simpl in Bt; unfold AbsRing_ball, abs, minus, plus, opp in Bt; simpl in Bt.
      apply Rabs_def2 in Bt. assert (Ht : 0 <= t < T) by (unfold T, G in *; lra).
      pose proof (position_common c h X Sl Hedges Hend Hprot Hgain Hcap inside_graph HX ltac:(fold a; rewrite C1; lia) t j Ht) as P. fold a G in P.
      rewrite !place_at, speed_at in P by lra. unfold away. fold G. rewrite P. fold v0.
      replace (end_state G (X 0 1%nat) j) with v1 by (unfold v1; f_equal; apply functional_extensionality; intros; unfold placed; simpl; ring).
      unfold placed. simpl. ring.
    + apply (filterlim_comp _ _ _ (glide a 0 (alpha c)) (fun y => h j + (v0 + y * v1)) (at_left T) (locally m)); [exact L|].
      apply (continuous_plus (fun _ => h j) (fun y => v0 + y * v1)); [apply continuous_const|].
      apply (continuous_plus (fun _ => v0) (fun y => y * v1)); [apply continuous_const|].
      apply (continuous_mult (fun y => y) (fun _ => v1)); [apply continuous_id|apply continuous_const].
  - exists (fun _ _ => 0). split; [intros M i l E; rewrite EM in E; discriminate|]. intros h X Sl j HX Hj.
    split; [intros; apply (agree_ok h X Sl); assumption|]. split; [contradiction|intros; apply (stops_ok h X Sl); assumption].
Qed.

(** * Numbers at the begin *)
Hypothesis Hroots : check_roots c = true.
Lemma value_ok f F m row : Checker.form N (dls d) (dL d) (ly f) = Some (F, m) -> check_rows N [row] = true ->
  Q2R (value_q a F m row) = V (edges G) (ly f) (at_ row).
Proof.
  intros EF HR. unfold value_q. rewrite (worth_ok (plain a) Hedges f F m [row] (fun _ => at_ row) EF HR eq_refl).
  - unfold value, double, sum. simpl. change (edges (graph (plain a))) with (edges G). rewrite (pair_self G f Hls F m EF). unfold at_ at 1. simpl. rewrite Q2R_1. ring.
  - intros i Hi. destruct i as [|i]; [reflexivity|simpl in Hi; lia].
Qed.
Lemma root_ok f F m rows x r : Checker.form N (dls d) (dL d) (ly f) = Some (F, m) -> check_root a F m rows r = true ->
  (forall i j, (i < length rows)%nat -> (j < N)%nat -> x i j = at_ (nth i rows []) j) -> root c f (length rows) x <= Q2R r.
Proof.
  intros EF H Hx. unfold check_root in H. fold G N in H. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2]. apply notneg_ok in H1.
  rewrite forallb_forall in H2. apply Qle_bool_iff, Qle_Rle in H3. rewrite Q2R_mult, (qsum_list _ _ []) in H3.
  rewrite <- (sqrt_square (Q2R r)) by exact H1. apply sqrt_le_1_alt. eapply Rle_trans; [|exact H3]. apply Req_le. apply sum_ext. intros i Hi.
  rewrite (value_ok f F m _ EF) by (apply H2, nth_In; exact Hi). apply (V_ext c f F m Hls EF). intros j Hj. apply Hx; assumption.
Qed.
Lemma map_reduced_at l : at_ (map reduced l) = at_ l.
Proof.
  apply functional_extensionality. intros j. unfold at_. change 0%Q with (reduced 0) at 1. rewrite map_nth. apply reduced_ok.
Qed.
Lemma pulled_ok x : length x = N -> good (common x) x = true -> forall j, (j < N)%nat -> at_ (pulled d x) j = lap (edges G) (at_ x) j.
Proof.
  intros Hx Hg j Hj. unfold pulled. cbv zeta. set (e := common x) in *. set (z := map (scaled e) x).
  pose proof (good_ok _ _ Hg) as [E0 _]. pose proof (good_ok _ _ Hls) as [D0 _]. apply IZR_lt in E0, D0.
  unfold at_ at 1. set (g := fun r => reduced (inject_Z (zdot r z) / inject_Z (dls d * e))).
  assert (LL : length (dL d) = N) by (change (dL d) with (lmat (dls d) (edges G) N); unfold lmat; rewrite map_length, seq_length; reflexivity).
  rewrite nth_indep with (d' := g []) by (rewrite map_length, LL; exact Hj). rewrite map_nth. unfold g. rewrite reduced_ok.
  assert (IZ : forall u, Q2R (inject_Z u) = IZR u) by (intros u; unfold Q2R; simpl; field).
  assert (NZ : ~ (inject_Z (dls d * e) == 0)%Q).
  { intros W. apply Qeq_eqR in W. rewrite IZ, Q2R_0, mult_IZR in W. assert (0 < IZR (dls d) * IZR e) by (apply Rmult_lt_0_compat; assumption). lra. }
  rewrite Q2R_div, !IZ, mult_IZR by exact NZ. rewrite <- zdot_ok.
  assert (Er : nth j (dL d) [] = lrow (dls d) (edges G) j).
  { change (dL d) with (lmat (dls d) (edges G) N). unfold lmat. apply nth_map_seq. exact Hj. }
  rewrite Er. assert (Ev : vec_of z = fun i => IZR e * at_ x i).
  { apply functional_extensionality. intros i. unfold vec_of, z. apply nth_scaled. exact Hg. }
  rewrite Ev. rewrite (lrow_ok (dls d) (edges G) j (fun i => IZR e * at_ x i) Hls), lap_scal. field. lra.
Qed.
Lemma added_ok g v x j : length v = length x -> at_ (added_rows g v x) j = at_ v j + Q2R g * at_ x j.
Proof.
  unfold at_, added_rows. revert x j. induction v as [|q v IH]; intros [|y x] j L; simpl in *; try discriminate.
  - destruct j; rewrite Q2R_0; ring.
  - destruct j as [|j]; simpl; [rewrite reduced_ok, Q2R_plus, Q2R_mult; reflexivity|]. apply IH. lia.
Qed.
Lemma rows_good l : check_rows N [l] = true -> length l = N /\ good (common l) l = true.
Proof.
  intros H. unfold check_rows in H. simpl in H. rewrite andb_true_r in H. apply andb_prop in H as [H1 H2]. apply Nat.eqb_eq in H1.
  rewrite app_nil_r in H2. split; assumption.
Qed.
Lemma starts_ok X Sl j : released c X Sl -> check_shape a = true -> (j < length (axes a))%nat -> let x := nth j (axes a) (Axis [] [] []) in
  (forall q, (q < N)%nat -> placed (spot a j) (X j 0) 0 q = at_ (place_row x) q) /\
  (forall q, (q < N)%nat -> X j 0 1%nat q = at_ (nth 1 (begins x) []) q) /\
  forall q, (q < N)%nat -> lag c (spot a j) (X j 0) 0 q = at_ (lag_row a x) q.
Proof.
  intros HX HS Hj x. unfold check_shape in HS. cbv zeta in HS. fold G N in HS. rewrite forallb_forall in HS.
  assert (Ex : nth_error (axes a) j = Some x) by (apply nth_error_nth'; exact Hj).
  specialize (HS x (nth_error_In _ _ Ex)). apply andb_prop in HS as [HS S4]. apply andb_prop in HS as [HS S3]. apply andb_prop in HS as [S1 S2].
  apply Nat.eqb_eq in S1, S2, S3. destruct (rows_good _ S4) as [L4 G4]. destruct (HX x j Ex) as [_ HB]. fold a G N in HB.
  assert (P : forall q, (q < N)%nat -> placed (spot a j) (X j 0) 0 q = at_ (place_row x) q).
  { intros q Hq. unfold place_row. rewrite map_reduced_at. unfold placed_q. cbv zeta. simpl. rewrite (less_ok a) by congruence. unfold placed. simpl.
    rewrite (HB 0%nat q ltac:(lia) Hq). reflexivity. }
  split; [exact P|]. split; [intros q Hq; apply (HB 1%nat q ltac:(lia) Hq)|].
  intros q Hq. unfold lag, lag_row. fold G d. rewrite (HB 1%nat q ltac:(lia) Hq).
  assert (LP : length (pulled d (place_row x)) = N).
  { unfold pulled. cbv zeta. rewrite map_length. change (dL d) with (lmat (dls d) (edges G) N). unfold lmat. rewrite map_length, seq_length. reflexivity. }
  rewrite added_ok by congruence. rewrite pulled_ok by assumption. rewrite (begin_ok a Hprot). fold a. rewrite (free c Hcap). fold a. f_equal. f_equal.
  apply (lap_ext N); [exact inside_graph|exact P].
Qed.
Lemma roots_ok i k f p : nth_error (used a) i = Some k -> nth_error (funcs G) k = Some f -> nth_error (firsts c) i = Some p -> roots_claim c f p.
Proof.
  intros Hu Ef Hp X Sl HX a'. unfold check_roots in Hroots. cbv zeta in Hroots. fold a G d in Hroots. fold N in Hroots.
  destruct (firsts c) as [|p0 l0] eqn:ER; [destruct i; discriminate|]. rewrite <- ER in *. apply andb_prop in Hroots as [HS HF].
  rewrite forallb_forall in HF.
  assert (Hi : In (k, p) (combine (used a) (firsts c))).
  { clear - Hu Hp. revert Hu Hp. generalize (used a) as u, (firsts c) as r. induction i as [|i IH]; intros [|x u] [|y r] H1 H2; simpl in *; try discriminate.
    - injection H1 as ->. injection H2 as ->. left. reflexivity.
    - right. apply IH; assumption. }
  specialize (HF _ Hi). cbn [fst snd] in HF. rewrite Ef in HF. destruct (Checker.form N (dls d) (dL d) (ly f)) as [[F m]|] eqn:EF; [|discriminate].
  apply andb_prop in HF as [F1 F2].
  split; [replace (length (axes a')) with (length (map place_row (axes a))) by apply map_length; apply (root_ok f F m _ _ _ EF F1)
    |replace (length (axes a')) with (length (map (lag_row a) (axes a))) by apply map_length; apply (root_ok f F m _ _ _ EF F2)];
    intros j q Hj Hq; rewrite map_length in Hj; destruct (starts_ok X Sl j HX HS Hj) as [P [_ L]].
  - rewrite nth_indep with (d' := place_row (Axis [] [] [])) by (rewrite map_length; exact Hj). rewrite map_nth. apply P. exact Hq.
  - rewrite nth_indep with (d' := lag_row a (Axis [] [] [])) by (rewrite map_length; exact Hj). rewrite map_nth. apply L. exact Hq.
Qed.

(** * The input *)
Variable hp : thrusts.
Hypothesis Hpush : check_push c hp = true.
Lemma begin_free : Q2R (begin_gain a) = eta a 0.
Proof. rewrite (begin_ok a Hprot). symmetry. apply (free c Hcap). Qed.
Lemma theta_begin : Q2R (theta_q a) = theta c 0.
Proof.
  destruct (T_k a Hprot) as [T0 K0]. pose proof (eta_pos a Hprot Hgain 0 T0) as E. unfold theta_q, theta. cbv zeta. fold a G.
  assert (N1 : ~ (begin_gain a == 0)%Q) by (intros W; apply Qeq_eqR in W; rewrite begin_free, Q2R_0 in W; exact (Rlt_not_eq _ _ E (eq_sym W))).
  assert (N2 : ~ (pull_in a == 0)%Q) by (intros W; apply Qeq_eqR in W; rewrite pull_ok, Q2R_0 in W; exact (Rlt_not_eq _ _ K0 (eq_sym W))).
  rewrite Q2R_div, Q2R_mult, !Q2R_minus, Q2R_div, Q2R_1, begin_free, pull_ok by assumption. reflexivity.
Qed.
Lemma larger_ok p q : Q2R (larger p q) = Rmax (Q2R p) (Q2R q).
Proof.
  unfold larger. destruct (Qle_bool p q) eqn:E.
  - apply Qle_bool_iff, Qle_Rle in E. rewrite Rmax_right by exact E. reflexivity.
  - destruct (Qlt_le_dec q p) as [L|L]; [|apply Qle_bool_iff in L; congruence]. apply Qlt_Rlt in L. rewrite Rmax_left by lra. reflexivity.
Qed.
Lemma scaled_at (g : Q -> Q) l j : Q2R (g 0%Q) = 0 -> at_ (map g l) j = Q2R (g (nth j l 0%Q)).
Proof.
  intros G0. unfold at_. destruct (Nat.lt_ge_cases j (length l)) as [L|L].
  - rewrite nth_indep with (d' := g 0%Q) by (rewrite map_length; exact L). rewrite map_nth. reflexivity.
  - rewrite !nth_overflow by (try rewrite map_length; exact L). rewrite G0. apply Q2R_0.
Qed.
Lemma mixed_ok X Sl i j : released c X Sl -> check_shape a = true -> (i < length (axes a))%nat -> (j < N)%nat ->
  mixed c (spot a i) (X i) 0 j = at_ (nth i (map (mixed_row a) (axes a)) []) j.
Proof.
  intros HX HS Hi Hj. destruct (starts_ok X Sl i HX HS Hi) as [P [W _]].
  rewrite nth_indep with (d' := mixed_row a (Axis [] [] [])) by (rewrite map_length; exact Hi). rewrite map_nth. set (x := nth i (axes a) _) in *.
  assert (LE : length (nth 1 (begins x) []) = length (place_row x)).
  { pose proof HS as H. unfold check_shape in H. cbv zeta in H. rewrite forallb_forall in H. specialize (H x (nth_In _ _ Hi)).
    apply andb_prop in H as [H S4]. apply andb_prop in H as [_ S3]. apply Nat.eqb_eq in S3. destruct (rows_good _ S4) as [L4 _]. rewrite S3, L4. reflexivity. }
  destruct (T_k a Hprot) as [T0 _]. pose proof (eta_pos a Hprot Hgain 0 T0) as E.
  unfold mixed_row. cbv zeta. rewrite scaled_at by (rewrite reduced_ok, Q2R_mult, Q2R_0; ring). rewrite reduced_ok, Q2R_mult.
  change (Q2R (nth j ?u 0%Q)) with (at_ u j). rewrite added_ok by exact LE. rewrite <- W, <- P by exact Hj.
  rewrite Q2R_mult, Q2R_plus, theta_begin, (inverse_ok (begin_gain a)) by (rewrite begin_free; exact E). rewrite begin_free.
  change (Q2R (alpha_q a)) with (alpha c). unfold mixed. rewrite place_at, speed_at by lra. fold a. field. lra.
Qed.
Lemma push_ok : push_claim c.
Proof.
  unfold push_claim. cbv zeta. fold a G N T. intros Ne X Sl t j Hj HX Ht. pose proof Hpush as H. unfold check_push in H. cbv zeta in H. fold a G d N in H.
  destruct (tops a) as [|q0 l0] eqn:Et; [contradiction|]. set (l := q0 :: l0) in *. clear Ne Et.
  apply andb_prop in H as [H H5]. apply andb_prop in H as [H H4]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  rewrite forallb_forall in H5. specialize (H5 j ltac:(apply in_seq; lia)). apply andb_prop in H5 as [H5 H8]. apply andb_prop in H5 as [H6 H7].
  set (m := length (axes a)) in *. set (w := nth j (speeds hp) 0%Q) in *. apply notneg_ok in H6.
  set (added := match kind G with Nominal _ => 0%Q | SlidingMode _ _ mu1 _ _ _ => (mu1 * index m)%Q end) in *.
  assert (EA : Q2R added = match kind G with Nominal _ => 0 | SlidingMode _ _ mu1 _ _ _ => Q2R mu1 * INR m end).
  { unfold added. destruct (kind G); [apply Q2R_0|]. rewrite Q2R_mult, index_ok. reflexivity. }
  rewrite <- EA. apply existsb_exists in H8 as [cs [Hk HB]]. apply in_flat_map in Hk as [[[kf p] [r qs]] [Hc Hk]].
  apply in_combine_l in Hc. unfold share_of in Hk. cbn [fst snd] in Hk. fold G d N in Hk.
  destruct (nth_error (funcs G) kf) as [f|] eqn:Ef; [|destruct Hk].
  destruct (Checker.form N (dls d) (dL d) (ly f)) as [[F mm]|] eqn:EF; [|destruct Hk].
  destruct (bounds_of G d f) as [[[vv es] cn]|] eqn:EB; [|destruct Hk].
  destruct (_ && _) eqn:EC in Hk; [|destruct Hk]. destruct Hk as [<-|[]].
  apply andb_prop in EC as [EC C4]. apply andb_prop in EC as [EC C3]. apply andb_prop in EC as [C1 C2].
  destruct (function_ok f (nth_error_In _ _ Ef)) as [F' [mm' [EF' [R1 [R2 [R3 _]]]]]]. rewrite EF in EF'. injection EF' as <- <-.
  rewrite forallb_forall in C4. specialize (C4 j ltac:(apply in_seq; lia)). apply andb_prop in C4 as [C4 C5]. apply notneg_ok in C4.
  set (C := nth j qs 0%Q) in *. apply Qle_bool_iff, Qle_Rle in C5. rewrite Q2R_mult in C5.
  destruct (T_k a Hprot) as [T0 K0]. fold G in K0. pose proof (eta_pos a Hprot Hgain 0 T0) as E. set (g := eta a 0) in *.
  assert (Np : Q2R (/ pull_in a) = / k G) by (rewrite inverse_ok; rewrite pull_ok; [reflexivity|exact K0]).
  (* numbers *)
  apply Qle_bool_iff, Qle_Rle in H4. rewrite Q2R_1, Q2R_mult, pull_ok in H4. change (Q2R (alpha_q a)) with (alpha c) in H4. fold G in H4.
  apply Qle_bool_iff, Qle_Rle in C1. rewrite Q2R_mult, pull_ok in C1. fold G in C1. replace (Q2R 4) with 4 in C1 by (unfold Q2R; simpl; lra).
  apply negb_true_iff in C2. destruct (Qlt_le_dec 5 (alpha_q a * pull_in a + rate f * pull_in a)) as [L|L]; [|apply Qle_bool_iff in L; congruence].
  apply Qlt_Rlt in L. rewrite Q2R_plus, !Q2R_mult, pull_ok in L. change (Q2R (alpha_q a)) with (alpha c) in L. fold G in L.
  replace (Q2R 5) with 5 in L by (unfold Q2R; simpl; lra). clear C2.
  set (kap := / k G) in *. assert (EK : kap * k G = 1) by (unfold kap; apply Rinv_l; lra).
  assert (A1 : 0 <= alpha c - kap) by (apply (Rmult_le_reg_r (k G)); [exact K0|]; rewrite Rmult_0_l, Rmult_minus_distr_r, EK; lra).
  assert (A2 : 0 <= Q2R (rate f) / 2 - 2 * kap) by (apply (Rmult_le_reg_r (k G)); [exact K0|]; rewrite Rmult_0_l, Rmult_minus_distr_r, Rmult_assoc, EK; lra).
  assert (A3 : 0 < alpha c - kap + (Q2R (rate f) / 2 - 2 * kap)).
  { apply (Rmult_lt_reg_r (k G)); [exact K0|]. rewrite Rmult_0_l, Rmult_plus_distr_r, !Rmult_minus_distr_r, Rmult_assoc, EK. lra. }
  set (M := Rmax 1 ((alpha c - kap + alpha c) / (alpha c - kap + (Q2R (rate f) / 2 - 2 * kap)))).
  assert (EM : Q2R (factor_q a f) = M).
  { unfold factor_q. cbv zeta. rewrite larger_ok, Q2R_1. assert (Z : Q2R (alpha_q a - / pull_in a + (rate f / 2 - 2 * / pull_in a)) = alpha c - kap + (Q2R (rate f) / 2 - 2 * kap)).
    { rewrite Q2R_plus, !Q2R_minus, Q2R_mult, Q2R_div, Np by (intros W; discriminate W). replace (Q2R 2) with 2 by (unfold Q2R; simpl; lra). reflexivity. }
    rewrite Q2R_div by (intros W; apply Qeq_eqR in W; rewrite Z, Q2R_0 in W; lra). rewrite Z, Q2R_plus, Q2R_minus, Np. reflexivity. }
  assert (M0 : 0 <= M) by (pose proof (Rmax_l 1 ((alpha c - kap + alpha c) / (alpha c - kap + (Q2R (rate f) / 2 - 2 * kap)))) as W; fold M in W; lra).
  destruct (theta_ok c Hprot Hgain Hcap 0 T0) as [_ K1]. fold a G kap in K1.
  destruct (Peak.bounds_ok G Hls (fun e He => proj2 (inside_graph e He)) H1 H2 (at_ (start G)) (fun _ _ => eq_refl) f vv es cn R3 R2 EB) as [_ [BK _]].
  assert (HC : forall y, Rabs (lap (edges G) y j) <= Q2R C * sqrt (V (edges G) (ly f) y)).
  { intros y. pose proof (V_pos c f F mm Hls EF R2 y) as VP. fold a G in VP. rewrite <- (sqrt_square (Q2R C)) by exact C4.
    rewrite <- sqrt_mult by (try exact VP; apply Rle_0_sqr). rewrite <- sqrt_Rsqr_abs. apply sqrt_le_1_alt. eapply Rle_trans; [exact (BK y j Hj)|].
    apply Rmult_le_compat_r; [exact VP|exact C5]. }
  set (A := Q2R C * M * sq g). assert (A0 : 0 <= A) by (unfold A; apply Rmult_le_pos; [apply Rmult_le_pos; assumption|apply Rle_0_sqr]).
  set (B := A * (kap - theta c 0)). assert (B0 : 0 <= B) by (unfold B; apply Rmult_le_pos; lra).
  assert (D0 : 0 <= alpha c * g) by (apply Rmult_le_pos; lra).
  set (u1 := fun i => sqrt (V (edges G) (ly f) (mixed c (spot a i) (X i) 0))). set (u2 := fun i => sqrt (V (edges G) (ly f) (placed (spot a i) (X i 0) 0))).
  set (u3 := fun i => Rabs (X i 0 1%nat j)).
  assert (One : forall i, (i < m)%nat -> Rabs (steer c (spot a i) (X i t) t j) <= A * u1 i + (B * u2 i + alpha c * g * u3 i)).
  { intros i Hi. destruct (HX _ i (nth_error_nth' (axes a) (Axis [] [] []) Hi)) as [HF _].
    pose proof (input_below c f F mm Hprot Hgain Hcap Hls EF R2 R1 Ha A1 A2 A3 _ (X i) (Sl i) HF j (Q2R C) t Hj C4 HC Ht) as I.
    rewrite place_at, speed_at in I by lra. change (at_ (offsets (nth i (axes a) (Axis [] [] [])))) with (spot a i) in I. fold a G kap g M in I.
    eapply Rle_trans; [exact I|]. apply Req_le. unfold A, B, A, u1, u2, u3. ring. }
  assert (S1 : over_space a (fun i => steer c (spot a i) (X i t) t j) <= A * size m u1 + (B * size m u2 + alpha c * g * size m u3)).
  { change (over_space a (fun i => steer c (spot a i) (X i t) t j)) with (size m (fun i => steer c (spot a i) (X i t) t j)).
    eapply Rle_trans; [apply size_le; exact One|]. eapply Rle_trans; [apply (size_plus m (fun i => A * u1 i) (fun i => B * u2 i + alpha c * g * u3 i))|].
    rewrite size_scal by exact A0. apply Rplus_le_compat_l. eapply Rle_trans; [apply (size_plus m (fun i => B * u2 i) (fun i => alpha c * g * u3 i))|].
    rewrite !size_scal by assumption. apply Rle_refl. }
  assert (Sq : forall (y : nat -> nat -> R), size m (fun i => sqrt (V (edges G) (ly f) (y i))) = root c f m y).
  { intros y. unfold size, root. fold a G. f_equal. apply sum_ext. intros i _. apply sqrt_sqrt, (V_pos c f F mm Hls EF R2). }
  assert (U1 : size m u1 <= Q2R r).
  { unfold u1. rewrite (Sq (fun i => mixed c (spot a i) (X i) 0)). unfold m. rewrite <- (map_length (mixed_row a)).
    apply (root_ok f F mm _ _ _ EF C3). intros i q Hi Hq. rewrite map_length in Hi. apply (mixed_ok X Sl i q HX H3 Hi Hq). }
  assert (U2 : size m u2 <= Q2R (fst p)).
  { unfold u2. rewrite (Sq (fun i => placed (spot a i) (X i 0) 0)). apply (In_nth_error) in Hc as [i Hi].
    assert (HH : nth_error (used a) i = Some kf /\ nth_error (firsts c) i = Some p).
    { clear - Hi. revert Hi. generalize (used a) as us, (firsts c) as fs. induction i as [|i IH]; intros [|x us] [|y fs] W; simpl in *; try discriminate.
      - injection W as -> ->. split; reflexivity.
      - apply IH. exact W. }
    destruct (roots_ok i kf f p (proj1 HH) Ef (proj2 HH) X Sl HX) as [W _]. exact W. }
  assert (U3 : size m u3 <= Q2R w).
  { unfold size, u3. rewrite <- (sqrt_square (Q2R w)) by exact H6. apply sqrt_le_1_alt. apply Qle_bool_iff, Qle_Rle in H7.
    rewrite Q2R_mult, (qsum_list _ _ (Axis [] [] [])) in H7. fold m in H7. eapply Rle_trans; [|exact H7]. apply Req_le. apply sum_ext. intros i Hi.
    destruct (starts_ok X Sl i HX H3 Hi) as [_ [W _]]. rewrite (W j Hj). rewrite Q2R_mult. unfold sq, at_. rewrite <- Rabs_mult. apply Rabs_right, Rle_ge, Rle_0_sqr. }
  apply Qle_bool_iff, Qle_Rle in HB. rewrite !Q2R_plus, !Q2R_mult, begin_free in HB. change (Q2R (alpha_q a)) with (alpha c) in HB. fold g in HB.
  change (Q2R (nth j ?z 0%Q)) with (at_ z j) in HB. rewrite scaled_at in HB by (rewrite Q2R_mult, Q2R_0; ring). fold C in HB.
  rewrite !Q2R_mult, Q2R_plus, Q2R_mult, Q2R_minus, EM, begin_free, theta_begin, Np in HB. fold g in HB.
  apply (Rmult_le_compat_l A) in U1; [|exact A0]. apply (Rmult_le_compat_l B) in U2; [|exact B0]. apply (Rmult_le_compat_l (alpha c * g)) in U3; [|exact D0].
  replace (Q2R C * (M * g * g * (Q2R r + (kap - theta c 0) * Q2R (fst p)))) with (A * Q2R r + B * Q2R (fst p)) in HB by (unfold B, A, sq; ring).
  change (at_ l j) with (Q2R (nth j l 0%Q)) in *. lra.
Qed.
End Sound.

Theorem accepts_cascade_sound h p c : accepts_cascade h p c = true -> true_cascade c.
Proof.
  intros H. unfold accepts_cascade in H. apply andb_prop in H as [H P8]. apply andb_prop in H as [H P7]. apply andb_prop in H as [H P6].
  apply andb_prop in H as [H P5]. apply andb_prop in H as [H P4]. apply andb_prop in H as [H P3]. apply andb_prop in H as [HG HE].
  apply negb_true_iff in HE. unfold true_cascade. cbv zeta. split; [apply (accepts_sound h); exact HG|]. unfold accepts in HG. rewrite HE in HG.
  unfold Checker.check in HG. set (d := prepare (graph (team c))) in *.
  repeat match type of HG with (_ && _ = true) => let K := fresh "G" in apply andb_prop in HG as [HG K] end.
  destruct (law_ok c P3) as [L1 [L2 [L3 L4]]]. split; [exact L1|]. split; [exact L2|]. split; [exact L4|]. split.
  { intros h0 x0. apply (launch c h0 x0); try assumption. intros e He. apply (inside_graph c); assumption. }
  split; [apply landing_ok; assumption|]. split; [apply (ends_ok (team c)); exact P7|]. split.
  { apply (push_ok c) with (hp := p); assumption. }
  intros i k Hu. destruct (used_ok c P3 k (nth_error_In _ _ Hu)) as [f [Ef _]]. exists f. split; [exact Ef|].
  split; [apply course_ok; try assumption; apply (nth_error_In _ _ Ef)|]. intros q Hq. apply (roots_ok c) with (i := i) (k := k); assumption.
Qed.
