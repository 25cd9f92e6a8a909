(** The check of certificates of many nodes, whose final states are enclosed. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Claims Input Mean Slide Exist Reach Main Table Dominance.
Require Import Weighted Rest Enclose Wide Group Sparse Factor Kept.
Open Scope R_scope.

(** what is found by search: of each Lyapunov function the vector of its rows, and the rates of closed components by
    themselves, 0 of single nodes; what sparse factors prove of some of these; left null vectors of
    balanced groups; of their nodes and of followers what encloses them *)
Record hints := Hints { vectors : list (list Q * list Q); facts : list fact; lefts : list stated; around : list Q }.

Definition leads (c : cert) (i : nat) : bool := match M.find i (places (map nodes (comps c))) with Some _ => true | None => false end.
(** leaders: unbalanced ones end at 0, single ones where they are, balanced groups where their left null vectors tell *)
Definition check_leaders (c : cert) (ls : list stated) (u : list Q) : bool :=
  let sf := scale_of c in
  let X := table (map (scaled sf) (map fst (final c))) in let R := table (map (scaled sf) (map snd (final c))) in
  let B := table (map (scaled sf) (start c)) in let B' := table (map (scaled sf) (sliding c)) in
  let E := listens (edges c) in let U := table (map (scaled (common u)) u) in
  let into := by_key (number (places (map nodes (comps c)))) (edges c) in
  good sf (start c) && good sf (sliding c) && good sf (map fst (final c)) && good sf (map snd (final c)) &&
  numbered 0 (fun k C => match camps C, nodes C with
    | Cycle _, l => forallb (fun i => Z.abs (get X i) <=? get R i)%Z l
    | Gauge _, [i] => (get E i =? 0)%Z && (Z.abs (get X i - (get B i - get B' i)) <=? get R i)%Z
    | Gauge g, l => ascending l && existsb (fun v => (which v =? k)%nat && check_kept (from_ into (S k)) l
        (by_node (map (fun i => (i, nth i g 0%Z)) l)) U X R (fun i => get B i - get B' i)%Z v) ls end) (comps c).
Definition check_final_large (c : cert) (ls : list stated) (u : list Q) : bool :=
  match final c with [] => true | _ => let pl := places (map nodes (comps c)) in
    check_leaders c ls u && check_followers c (fun i => match M.find i pl with Some _ => true | None => false end) u end.
Definition weights_of (f : func) : list Q := match ly f with Weighted p => p | _ => [] end.
Definition check_function_large (c : cert) (pl : place) (into : ways) (facts : list fact) (f : func) (v : list Q * list Q) : bool :=
  let K := common (rate f :: snd v) in let p := weights_of f in let P := table (map (scaled (common p)) p) in
  let gz := table (map (scaled K) (snd v)) in
  good K (rate f :: snd v) && good (common p) p &&
  numbered 0 (fun k C => existsb (fun F => fits F k (nodes C) P (nth k (snd v) 0%Q)) facts || check_group (from_ into (S k)) (nodes C) (camps C) (weights_of f) (nth k (snd v) 0%Q)) (comps c) &&
  check_weighted c (from_ into 0) (fst v) (fun i => match M.find i pl with Some k => get gz k | None => 0%Z end) K f.
Definition check_functions (c : cert) (vs : list (list Q * list Q)) (facts : list fact) : bool :=
  let Cs := map nodes (comps c) in let pl := places Cs in let into := by_key (number pl) (edges c) in
  (length (funcs c) =? length vs)%nat && forallb ascending Cs &&
  forallb (fun F => check_factor (from_ into (S (whose F))) (nth (whose F) Cs []) F) facts &&
  forallb (fun p : func * (list Q * list Q) => check_function_large c pl into facts (fst p) (snd p)) (combine (funcs c) vs).
Definition check_moves (c : cert) : bool :=
  match edges c with [] => true | _ => existsb (fun f => pos (rate f)) (funcs c) end.
Definition check_input_large (c : cert) : bool :=
  negb (bounded_input c) || (match edges c with [] => true | _ => false end) ||
  existsb (fun f => Qle_bool 2 (rho2 c * kappa c * rate f)) (funcs c).
Definition check_rest (c : cert) : bool :=
  match margins c, leaders c, upper_bound c, efforts c with [], [], None, [] => true | _, _, _, _ => false end.
Definition check_large (h : hints) (c : cert) : bool :=
  enclosed c && check_edges c (common (map wt (edges c))) && check_protocol c && wide_structure c && wide_claims c &&
  check_functions c (vectors h) (facts h) && check_moves c && check_final_large c (lefts h) (around h) && check_input_large c && check_rates c &&
  check_rest c && check_sliding c.

Section Large.
Variables (h : hints) (c : cert).
Let es := edges c.
Let n := order c.
Hypothesis Hedges : check_edges c (common (map wt (edges c))) = true.
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hstructure : wide_structure c = true.
Hypothesis Hclaims : wide_claims c = true.
Hypothesis Hfunctions : check_functions c (vectors h) (facts h) = true.
Lemma edges_in e : In e es -> (tgt e < n)%nat /\ (src e < n)%nat.
Proof.
  intros He. unfold check_edges in Hedges. apply andb_prop in Hedges as [_ H]. rewrite forallb_forall in H. specialize (H e He).
  apply andb_prop in H as [H _]. apply andb_prop in H as [H _]. apply andb_prop in H as [H1 H2].
  split; apply Nat.ltb_lt; assumption.
Qed.
Lemma edges_not_zero e : In e es -> Q2R (wt e) <> 0.
Proof.
  intros He. unfold check_edges in Hedges. apply andb_prop in Hedges as [_ H]. rewrite forallb_forall in H. specialize (H e He).
  apply andb_prop in H as [_ H]. apply negb_true_iff, Z.eqb_neq in H. unfold Q2R. intros Z. apply Rmult_integral in Z as [Z|Z].
  - apply eq_IZR in Z. contradiction.
  - assert (0 < / IZR (Zpos (Qden (wt e)))) by (apply Rinv_0_lt_compat; apply IZR_lt; reflexivity). lra.
Qed.
Lemma own_lap j i y : let Cs := map nodes (comps c) in (j < length Cs)%nat -> In i (nth j Cs []) ->
  lap (from_ (by_key (number (places Cs)) es) (S j)) y i = lap es y i.
Proof.
  intros Cs Hj Hi. destruct (wide_parts c Hstructure) as [W0 _]. fold Cs in W0.
  rewrite key_filter. apply lap_filter. intros e He Hkey Et. apply Nat.eqb_neq in Hkey. apply Hkey.
  assert (K : In e (from_ (by_key (number (places Cs)) es) (S j))).
  { apply (number_In Cs es j e W0 Hj). split; [exact He|]. rewrite Et. exact Hi. }
  apply key_In in K. apply K.
Qed.
Lemma function_large f : In f (funcs c) -> function_claim c f /\ exists p, ly f = Weighted p.
Proof.
  intros Hf. unfold check_functions in Hfunctions. cbv zeta in Hfunctions. set (Cs := map nodes (comps c)) in *.
  apply andb_prop in Hfunctions as [L H]. apply andb_prop in L as [L Hfacts]. apply andb_prop in L as [L Asc]. rewrite forallb_forall in Hfacts. apply Nat.eqb_eq in L.
  rewrite forallb_forall in H, Asc. destruct (in_nth (funcs c) f f Hf) as [k [Hk E]]. set (v := nth k (vectors h) ([], [])).
  assert (Kin : In (f, v) (combine (funcs c) (vectors h))).
  { replace (f, v) with (nth k (combine (funcs c) (vectors h)) (f, ([], []))).
    - apply nth_In. rewrite combine_length. lia.
    - rewrite combine_nth by exact L. rewrite E. reflexivity. }
  specialize (H _ Kin). unfold check_function_large in H. cbv zeta in H. cbn [fst snd] in H.
  set (K := common (rate f :: snd v)) in *. set (gz := table (map (scaled K) (snd v))) in *.
  apply andb_prop in H as [H HW]. apply andb_prop in H as [HK HG]. apply andb_prop in HK as [HK Hp].
  assert (HK' : good K (snd v) = true).
  { unfold good in *. apply andb_prop in HK as [A B]. simpl in B. apply andb_prop in B as [_ B]. rewrite A, B. reflexivity. }
  destruct (good_ok _ _ HK) as [K0 _]. destruct (wide_parts c Hstructure) as [W0 [W1 [W2 _]]]. fold Cs in W0.
  pose proof HW as H'. unfold check_weighted in H'. destruct (ly f) as [P|p g|p] eqn:El; try discriminate.
  split; [|exists p; reflexivity].
  assert (Eout : from_ (by_key (number (places Cs)) es) 0 = filter (fun e => (number (places Cs) e =? 0)%nat) es) by apply key_filter.
  apply (whole_weighted_ok c (from_ (by_key (number (places Cs)) es) 0) (fst v) _ K f p edges_in Hprot) in HW; [exact HW| |exact El|].
  - intros e He. rewrite Eout in He. apply filter_In in He. apply He.
  - intros x z. fold es n. rewrite Eout.
    rewrite (fsum_ext _ _ (fun i => gamma_of Cs (snd v) i * (Q2R (nth i p 0%Q) * sq (z i)))).
    + apply (groups_ok n es Cs (snd v) p W0 (fun C HC => Asc C HC)).
      * intros C i HC Hi. apply in_map_iff in HC as [D [<- HD]]. apply (W1 D i HD Hi).
      * intros j Hj. rewrite <- key_filter. unfold Cs in Hj. rewrite map_length in Hj. set (C0 := Comp [] (Cycle []) [] []).
        pose proof (numbered_ok _ _ C0 0%nat HG j Hj) as G. rewrite Nat.add_0_l in G. cbv beta in G.
        assert (EC : nth j Cs [] = nodes (nth j (comps c) C0)) by (unfold Cs; change (@nil nat) with (nodes C0); apply map_nth).
        unfold weights_of in G, Hp. rewrite El in G, Hp. rewrite <- EC in G.
        assert (Hj' : (j < length Cs)%nat) by (unfold Cs; rewrite map_length; exact Hj).
        assert (Own : forall i, In i (nth j Cs []) -> forall y, lap (from_ (by_key (number (places Cs)) es) (S j)) y i = lap es y i)
          by (intros i Hi y; apply own_lap; assumption).
        apply orb_prop in G as [G|G].
        -- apply existsb_exists in G as [F [HF G]]. specialize (Hfacts F HF).
           assert (W : whose F = j) by (unfold fits in G; apply andb_prop in G as [G _]; apply andb_prop in G as [G _]; apply Nat.eqb_eq; exact G).
           rewrite W in Hfacts. apply (fact_ok es _ (nth j Cs []) F j p _ x); auto. apply ascending_NoDup. apply Asc. apply nth_In. exact Hj'.
        -- apply (group_ok es _ (nth j Cs []) (camps (nth j (comps c) C0)) p (nth j (snd v) 0%Q) x Own); [|exact G].
           intros e He. apply (number_In Cs es j e W0 Hj') in He. apply He.
    + intros i _. f_equal. unfold gamma_of. destruct (M.find i (places Cs)) as [j|].
      * unfold gz. rewrite get_table, nth_scaled by exact HK'. apply IZR_lt in K0. field. lra.
      * unfold Rdiv. ring.
Qed.
Lemma lap_bounded : exists B, 0 <= B /\ forall x i, (i < n)%nat -> sq (lap es x i) <= B * norm2 n x.
Proof. apply (lap_bound c). intros e He. apply (edges_in e He). Qed.

(** the limit of one motion *)
Lemma settles_down : check_moves c = true -> forall X Sl t0, moves_from c X Sl t0 -> exists y r C, 0 < r /\ 0 <= C /\
  (forall i, (i < n)%nat -> filterlim (fun t => X t i) (at_left (deadline c)) (locally (y i))) /\
  (forall i, (i < n)%nat -> lap es y i = 0) /\
  (forall t i, t0 <= t < deadline c -> (i < n)%nat -> Rabs (X t i - y i) <= 2 * C / r * exp (- (r / 2 * s c t))) /\
  forall v, (forall t, t0 <= t < deadline c -> Rabs v <= 2 * C / r * exp (- (r / 2 * s c t))) -> v = 0.
Proof.
  intros H X Sl t0 HX. pose proof HX as [[HM _] HQ]. destruct (T_pos c Hprot) as [P1 [P2 P3]].
  assert (E : exists r C, 0 < r /\ 0 <= C /\ forall t i, t0 <= t < deadline c -> (i < n)%nat ->
    sq (lap es (X t) i) <= sq C * exp (- (r * clock (deadline c) (Q2R (rho1 c)) (k c) t))).
  { unfold check_moves in H. fold es in H. destruct es as [|e l] eqn:Ee.
    - exists 1, 0. split; [lra|]. split; [lra|]. intros t i _ _. unfold lap. simpl. unfold sq. lra.
    - rewrite <- Ee. apply existsb_exists in H as [f [Hf Hr]]. destruct (function_large f Hf) as [[Cl _] [p El]].
      set (a := Rabs (Q2R (overshoot f) * (exp (Q2R (rate f) * s c t0) * norm2 n (lap es (X t0))))).
      exists (Q2R (rate f)), (sqrt a). split; [exact (Qpos _ Hr)|]. split; [apply sqrt_pos|]. intros t i Ht Hi.
      destruct (Cl X Sl t0 t HX Ht) as [_ [N _]]. rewrite El in N. cbn [coords] in N. fold es n in N.
      eapply Rle_trans; [apply (norm2_entry n (lap es (X t)) i Hi)|]. eapply Rle_trans; [exact N|].
      assert (A : sq (sqrt a) = a) by (unfold sq; apply sqrt_sqrt; apply Rabs_pos). rewrite A. fold (s c t).
      replace (- (Q2R (rate f) * (s c t - s c t0))) with (Q2R (rate f) * s c t0 + - (Q2R (rate f) * s c t)) by ring.
      rewrite exp_plus. set (e1 := exp (- (Q2R (rate f) * s c t))). assert (0 < e1) by apply exp_pos.
      replace (Q2R (overshoot f) * (exp (Q2R (rate f) * s c t0) * e1 * norm2 n (lap es (X t0))))
        with (Q2R (overshoot f) * (exp (Q2R (rate f) * s c t0) * norm2 n (lap es (X t0))) * e1) by ring.
      apply Rmult_le_compat_r; [lra|]. apply Rle_abs. }
  destruct E as [r [C [R0 [C0 E]]]].
  destruct (comes_to_rest n es _ _ _ P1 P2 P3 lap_bounded X Sl t0 HM HQ r C R0 C0 E) as [y [Y1 [Y2 Y3]]].
  exists y, r, C. split; [exact R0|]. split; [exact C0|]. split; [exact Y1|]. split; [exact Y2|]. split; [exact Y3|].
  intros v Hv. apply (vanishes n _ _ _ P1 P2 P3 Sl t0 HQ r C R0 C0 v). exact Hv.
Qed.

(** leaders within their intervals *)
Lemma leaders_ok X Sl t0 y : check_leaders c (lefts h) (around h) = true -> moves_from c X Sl t0 -> at_rest c y ->
  (forall j, (j < n)%nat -> X 0 j - Sl 0 j = begin c j) ->
  (forall D lam, (forall i, In i D -> (i < n)%nat) -> (forall x, fsum D (fun i => lam i * lap es x i) = 0) ->
    fsum D (fun i => lam i * y i) = fsum D (fun i => lam i * (X 0 i - Sl 0 i))) ->
  forall i, (i < n)%nat -> leads c i = true -> Rabs (Q2R (fst (nth i (final c) (0%Q, 0%Q))) - y i) <= Q2R (snd (nth i (final c) (0%Q, 0%Q))).
Proof.
  intros H HX [_ [HC _]] H0 Hk i Hi Hl. unfold check_leaders in H. cbv zeta in H. set (sf := scale_of c) in *.
  apply andb_prop in H as [H H5]. apply andb_prop in H as [H H4]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  unfold leads in Hl. destruct (M.find i _) as [j|] eqn:E; [|discriminate]. clear Hl.
  apply places_some in E as [Hj Hin]. rewrite map_length in Hj. set (C0 := Comp [] (Cycle []) [] []).
  change (@nil nat) with (nodes C0) in Hin. rewrite map_nth in Hin. set (C := nth j (comps c) C0) in *.
  assert (HCin : In C (comps c)) by (apply nth_In; exact Hj). pose proof (numbered_ok _ _ C0 0%nat H5 j Hj) as H5'.
  clear H5. rename H5' into H5. rewrite Nat.add_0_l in H5. fold C in H5. cbv beta in H5. pose proof HC as HC'. specialize (HC C i HCin Hin).
  set (p := nth i (final c) (0%Q, 0%Q)).
  assert (EX : IZR (get (table (map (scaled sf) (map fst (final c)))) i) = IZR sf * Q2R (fst p)).
  { rewrite get_table, nth_scaled by exact H3. unfold p. change 0%Q with (fst (0%Q, 0%Q)) at 1. rewrite map_nth. reflexivity. }
  assert (ES : IZR (get (table (map (scaled sf) (map snd (final c)))) i) = IZR sf * Q2R (snd p)).
  { rewrite get_table, nth_scaled by exact H4. unfold p. change 0%Q with (snd (0%Q, 0%Q)) at 1. rewrite map_nth. reflexivity. }
  destruct (good_ok _ _ H1) as [L _]. apply IZR_lt in L.
  assert (Fin : forall v, IZR sf * Rabs (Q2R (fst p) - v) <= IZR sf * Q2R (snd p) -> Rabs (Q2R (fst p) - v) <= Q2R (snd p)).
  { intros v Hv. apply (Rmult_le_reg_l (IZR sf)); assumption. }
  assert (EB : forall i, IZR (get (table (map (scaled sf) (start c))) i - get (table (map (scaled sf) (sliding c))) i) = IZR sf * begin c i).
  { intros j0. rewrite minus_IZR, !get_table, !nth_scaled by assumption. unfold begin. ring. }
  destruct (camps C) as [g|cy] eqn:Ec.
  - destruct (nodes C) as [|a [|b l]] eqn:En; [destruct Hin| |].
    + destruct Hin as [->|[]]. apply andb_prop in H5 as [A B]. apply Z.eqb_eq in A. apply Z.leb_le, IZR_le in B. rewrite abs_IZR, minus_IZR, EB in B.
      assert (Ey : y i = begin c i).
      { rewrite <- (H0 i Hi). specialize (Hk [i] (fun _ => 1)). simpl in Hk. rewrite !Rmult_1_l, !Rplus_0_r in Hk. apply Hk.
        - intros k [<-|[]]. exact Hi.
        - intros x. rewrite (quiet_node es x i A). ring. }
      apply Fin. rewrite <- ES, <- (Rabs_right (IZR sf)) at 1 by lra. rewrite <- Rabs_mult, Rmult_minus_distr_l, <- EX, Ey. exact B.
    + rewrite <- En in *. apply andb_prop in H5 as [As H5]. apply existsb_exists in H5 as [v [_ Hv]]. apply andb_prop in Hv as [_ Hv].
      pose proof (ascending_NoDup _ As) as ND. destruct (wide_parts c Hstructure) as [_ [W1 _]].
      assert (EC : nth j (map nodes (comps c)) [] = nodes C) by (change (@nil nat) with (nodes C0); apply map_nth).
      assert (Hj' : (j < length (map nodes (comps c)))%nat) by (rewrite map_length; exact Hj).
      set (gm := by_node _) in Hv.
      assert (Eg : forall k, In k (nodes C) -> IZR (get gm k) = sgn g k).
      { intros k Hk'. unfold gm. rewrite (by_node_at (fun i => nth i g 0%Z)) by exact Hk'. reflexivity. }
      apply (kept_ok _ (nodes C) gm _ _ _ _ v Hv ND (IZR sf) (begin c) y (fun k => Q2R (fst (nth k (final c) (0%Q, 0%Q)))) (fun k => Q2R (snd (nth k (final c) (0%Q, 0%Q)))) L); auto.
      * intros k. rewrite get_table, nth_scaled by exact H3. change 0%Q with (fst (0%Q, 0%Q)) at 1. rewrite map_nth. reflexivity.
      * intros k. rewrite get_table, nth_scaled by exact H4. change 0%Q with (snd (0%Q, 0%Q)) at 1. rewrite map_nth. reflexivity.
      * intros k Hk'. specialize (HC' C k HCin Hk'). cbv zeta in HC'. rewrite Ec in HC'.
        assert (Hh : In (hd O (nodes C)) (nodes C)) by (rewrite En; left; reflexivity). rewrite !Eg by assumption. exact HC'.
      * intros w Hw. rewrite (Hk (nodes C) w).
        -- apply fsum_ext. intros k Hk'. rewrite (H0 k); [reflexivity|apply (W1 C k HCin Hk')].
        -- intros k Hk'. apply (W1 C k HCin Hk').
        -- intros x. set (own := from_ _ _) in *.
           assert (Hin' : forall e, In e own -> In (tgt e) (nodes C) /\ In (src e) (nodes C)).
           { unfold check_kept in Hv. cbv zeta in Hv. do 8 (apply andb_prop in Hv as [Hv _]). apply andb_prop in Hv as [_ Hv].
             rewrite forallb_forall in Hv. intros e He. specialize (Hv e He). apply andb_prop in Hv as [P Q]. split; apply marked_In; assumption. }
           transitivity (fsum (nodes C) (fun k => w k * lap own x k)).
           { apply fsum_ext. intros k Hk'. f_equal. symmetry. apply own_lap; [exact Hj'|rewrite EC; exact Hk']. }
           rewrite <- (column_ok own (nodes C) Hin' ND w x). rewrite (fsum_ext _ _ (fun _ => 0 * 1)); [rewrite fsum_scal; ring|].
           intros k Hk'. rewrite (Hw k Hk'). ring.
  - rewrite forallb_forall in H5. specialize (H5 i Hin). apply Z.leb_le, IZR_le in H5. rewrite abs_IZR in H5.
    apply Fin. rewrite <- ES, <- (Rabs_right (IZR sf)) at 1 by lra. rewrite <- Rabs_mult, Rmult_minus_distr_l, <- EX.
    rewrite HC. rewrite Rmult_0_r, Rminus_0_r. exact H5.
Qed.
Lemma limit_large : enclosed c = true -> check_moves c = true -> check_final_large c (lefts h) (around h) = true -> limit_claim c.
Proof.
  intros HE HM HF X Sl HX. destruct (settles c Hprot X Sl HX) as [t0 HS].
  destruct (settles_down HM X Sl t0 HS) as [y [r [C [R0 [C0 [Y1 [Y2 [Y3 Y4]]]]]]]].
  exists y. split; [exact Y1|]. rewrite HE. cbv zeta.
  destruct (wide_parts c Hstructure) as [_ [W1 [_ W2]]]. destruct (wide_claims_ok c Hclaims) as [K1 _].
  assert (HR : at_rest c y).
  { apply (rests_ok c edges_in edges_not_zero (wide_structure_ok c Hstructure) K1 W2 y Y2). }
  split; [exact HR|]. intros H0 i Hl Hi. cbv zeta. unfold check_final_large in HF.
  destruct (final c) as [|p0 l] eqn:Ef; [simpl in Hl; lia|]. rewrite <- Ef in *. apply andb_prop in HF as [F1 F2].
  apply (followers_ok c (leads c) (around h) y edges_in Y2 F2); [|exact Hi].
  intros j Hj Lj. apply (leaders_ok X Sl t0 y F1 HS HR H0); [|exact Hj|exact Lj].
  intros D lam HD HL. pose proof HS as [[HM0 _] HQ]. destruct (T_pos c Hprot) as [P1 _].
  pose proof (kept_sum n es _ _ _ X Sl t0 D lam P1 HM0 HQ HD HL) as Kp.
  set (a := fsum D (fun i => Rabs (lam i)) + 1).
  assert (A0 : 0 < a).
  { unfold a. assert (0 <= fsum D (fun i => Rabs (lam i))); [|lra]. clear. induction D as [|i D IH]; simpl; [lra|]. pose proof (Rabs_pos (lam i)). lra. }
  apply Rminus_diag_uniq. set (d := _ - _). assert (Z : d / a = 0); [|apply (Rmult_eq_reg_r (/ a)); [unfold Rdiv in Z; lra|apply Rinv_neq_0_compat; lra]].
  apply Y4. intros t Ht. set (e := 2 * C / r * exp (- (r / 2 * s c t))).
  assert (E0 : 0 <= e).
  { unfold e. apply Rmult_le_pos; [|left; apply exp_pos]. apply Rmult_le_pos; [lra|]. left. apply Rinv_0_lt_compat. exact R0. }
  assert (B : Rabs d <= fsum D (fun i => Rabs (lam i)) * e).
  { unfold d. rewrite <- (Kp t Ht). clear Kp HL d. revert HD. clear - Y3 Ht. induction D as [|i D IH]; intros HD; simpl; [rewrite Rminus_0_r, Rabs_R0; lra|].
    replace (lam i * y i + fsum D (fun i => lam i * y i) - (lam i * X t i + fsum D (fun i => lam i * X t i)))
      with (- (lam i * (X t i - y i)) + (fsum D (fun i => lam i * y i) - fsum D (fun i => lam i * X t i))) by ring.
    eapply Rle_trans; [apply Rabs_triang|]. rewrite Rmult_plus_distr_r. apply Rplus_le_compat; [|apply IH; intros; apply HD; right; assumption].
    rewrite Rabs_Ropp, Rabs_mult. apply Rmult_le_compat_l; [apply Rabs_pos|]. apply Y3; [exact Ht|apply HD; left; reflexivity]. }
  unfold Rdiv. rewrite Rabs_mult, (Rabs_right (/ a)) by (left; apply Rinv_0_lt_compat; exact A0).
  apply (Rmult_le_reg_r a); [exact A0|]. rewrite Rmult_assoc, Rinv_l, Rmult_1_r by lra. unfold a. rewrite (Rmult_comm e). lra.
Qed.
Lemma input_large : check_input_large c = true -> input_claim c.
Proof.
  intros H Hb X Sl t0 HX.
  enough (exists K, forall t i, t0 <= t < deadline c -> (i < order c)%nat ->
    Rabs (gain (deadline c) (Q2R (rho1 c)) (k c) t * lap (edges c) (X t) i) <= K) as [K HK]
    by (exists K; intros; unfold input; rewrite Rabs_Ropp; auto).
  unfold check_input_large in H. rewrite Hb in H. simpl in H. destruct (T_pos c Hprot) as [P1 [P2 P3]].
  apply orb_prop in H as [H|H].
  - exists 0. intros t i _ _. destruct (edges c) eqn:E; [|discriminate]. simpl. rewrite Rmult_0_r, Rabs_R0. lra.
  - apply existsb_exists in H as [f [Hf Hr]]. destruct (function_large f Hf) as [[Cl _] [p El]].
    apply Qle_bool_iff, Qle_Rle in Hr. rewrite !Q2R_mult in Hr. fold (k c) in Hr. replace (Q2R 2) with 2 in Hr by (unfold Q2R; simpl; lra).
    pose proof HX as [_ HQ].
    apply (input_bounded n _ _ _ P1 P2 P3 (Q2R (rate f)) t0 (proj1 HQ) ltac:(lra) (fun t i => lap (edges c) (X t) i)
      (Rabs (Q2R (overshoot f)) * norm2 n (lap (edges c) (X t0)))).
    intros t i Ht Hi. destruct (Cl X Sl t0 t HX Ht) as [_ [N _]]. rewrite El in N. cbn [coords] in N. fold n in N.
    eapply Rle_trans; [apply (norm2_entry n (lap (edges c) (X t)) i Hi)|]. eapply Rle_trans; [exact N|].
    fold (s c t) (s c t0). set (e := exp _). set (N0 := norm2 _ _).
    assert (0 <= N0) by apply norm2_pos. assert (0 < e) by apply exp_pos.
    replace (Q2R (overshoot f) * (e * N0)) with (Q2R (overshoot f) * (N0 * e)) by ring. rewrite Rmult_assoc.
    apply Rmult_le_compat_r; [apply Rmult_le_pos; lra|apply Rle_abs].
Qed.
End Large.

Theorem large_sound h c : check_large h c = true -> true_certificate c.
Proof.
  intros H. unfold check_large in H. apply andb_prop in H as [H H12]. apply andb_prop in H as [H H11].
  apply andb_prop in H as [H H10]. apply andb_prop in H as [H H9]. apply andb_prop in H as [H H8]. apply andb_prop in H as [H H7].
  apply andb_prop in H as [H H6]. apply andb_prop in H as [H H5]. apply andb_prop in H as [H H4]. apply andb_prop in H as [H H3].
  apply andb_prop in H as [H1 H2].
  destruct (wide_claims_ok c H5) as [K1 K2]. unfold check_rest in H11.
  destruct (margins c) eqn:Em; [|discriminate]. destruct (leaders c) eqn:El; [|discriminate]. destruct (upper_bound c) eqn:Eu; [discriminate|]. destruct (efforts c) eqn:Ee; [|discriminate].
  split; [apply wide_structure_ok; exact H4|]. split; [exact K2|]. split; [exact K1|].
  split; [intros E; rewrite H1 in E; discriminate|].
  split; [intros f Hf; apply (function_large h c H2 H3 H4 H6 f Hf)|].
  split; [apply (limit_large h c H2 H3 H4 H5 H6 H1 H7 H8)|]. split; [apply (input_large h c H2 H3 H4 H6 H9)|].
  split; [apply rates_ok; exact H10|]. split; [apply sliding_ok; assumption|]. split; [apply motions_exist; assumption|].
  split; [intros m Hm; rewrite Em in Hm; destruct Hm|]. split; [intros l Hl; rewrite El in Hl; destruct Hl|].
  split; [intros u Hu; rewrite Eu in Hu; discriminate|]. intros e He. rewrite Ee in He. destruct He.
Qed.
(** a certificate of either form *)
Definition accepts (h : hints) (c : cert) : bool := if enclosed c then check_large h c else check c.
Theorem accepts_sound h c : accepts h c = true -> true_certificate c.
Proof. unfold accepts. destruct (enclosed c) eqn:E; [apply large_sound|apply small_sound; exact E]. Qed.
