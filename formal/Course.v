(** From the record to what bounds the input while sliding variables move: pieces of the time, and what a Lyapunov
    function of the record is at most in them. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Certificate Checker Flow Sound Slide Solution Exist Input Effort Peak Reach Driven Moving Spent Measure Largest.
Open Scope R_scope.

Lemma nth_sided x A i : nth i (map (sided x) A) 0%Z = sided x (nth i A []).
Proof. exact (map_nth (sided x) A [] i). Qed.
Lemma unit_len i a : length (unit i a) = S i.
Proof. unfold unit. rewrite app_length, repeat_length. simpl. lia. Qed.

(** * The coordinates of a Lyapunov function in integers *)
Section Rows.
Variables (c : cert) (f : func) (F : mat) (m : Z).
Let d := prepare c.
Let n := order c.
Let es := edges c.
Hypothesis Hls : good (dls d) (map wt es) = true.
Hypothesis HF : form n (dls d) (dL d) (ly f) = Some (F, m).
Lemma V_same x y : (forall i, (i < n)%nat -> x i = y i) -> V es (ly f) x = V es (ly f) y.
Proof.
  intros H. destruct (form_ok n _ _ _ _ _ _ Hls eq_refl HF) as [Hm [HFt HV]]. destruct (fits_ok _ _ HFt) as [F1 F2].
  apply IZR_lt in Hm. apply (Rmult_eq_reg_l (IZR m)); [|lra]. rewrite <- !HV.
  rewrite (bil_ext_l F x y) by (intros; apply H; lia). apply (bil_ext_r F n y x y F2 H).
Qed.
Lemma rows_ok A u P e : rows_of c d f = (A, u, P, e) -> (0 < u)%Z /\ (0 < e)%Z /\ rows_le n P /\ (length P <= n)%nat /\
  forall x, (forall i, (n <= i)%nat -> x i = 0) ->
  V es (ly f) x = bil P (fun i => dot (nth i A []) x) (fun i => dot (nth i A []) x) / (IZR e * (IZR u * IZR u)).
Proof.
  unfold rows_of. destruct (good_ok _ _ Hls) as [Hl _]. unfold form in HF. destruct (ly f) as [B|p g|p]; [| |discriminate].
  - cbv zeta in HF. intros E. injection E as <- <- <- <-. set (e := common (concat B)) in *. set (PZ := map (map (scaled e)) B) in *.
    destruct (_ && _) eqn:K in HF; [|discriminate]. apply andb_prop in K as [K _]. apply andb_prop in K as [K K3].
    apply andb_prop in K as [K1 K2]. apply Z.ltb_lt in K2. destruct (fits_ok _ _ K3) as [F1 F2].
    split; [exact Hl|]. split; [exact K2|]. split; [exact F2|]. split; [exact F1|]. intros x _. cbn [V coords].
    assert (R : forall i, (i < n)%nat -> dot (nth i (dL d) []) x = IZR (dls d) * lap es x i).
    { intros i Hi. change (dL d) with (lmat (dls d) es n). unfold lmat. rewrite nth_map_seq by exact Hi. apply lrow_ok. exact Hls. }
    rewrite (bil_ext_l PZ _ (fun i => IZR (dls d) * lap es x i)) by (intros; apply R; unfold n; lia).
    rewrite (bil_ext_r PZ n _ _ (fun i => IZR (dls d) * lap es x i) F2) by (intros; apply R; assumption).
    rewrite bil_scal_l, bil_scal_r. unfold PZ. rewrite (bil_scaled e B K1). apply IZR_lt in Hl, K2. change (common (map wt (edges c))) with (dls d). field. lra.
  - cbv zeta in HF. intros E. injection E as <- <- <- <-. set (e := common p) in *. set (pz := map (scaled e) p) in *.
    set (t := zsum pz) in *. set (h := hadamard g pz) in *.
    destruct (_ && _) eqn:K in HF; [|discriminate]. apply andb_prop in K as [K K5]. apply andb_prop in K as [K K4].
    apply andb_prop in K as [K K3]. apply andb_prop in K as [K1 K2]. apply Z.ltb_lt in K4. apply Nat.eqb_eq in K2.
    destruct (good_ok _ _ K1) as [He _]. injection HF as <- <-. destruct (fits_ok _ _ K5) as [F1 F2].
    assert (Lp : length pz = length p) by (unfold pz; apply map_length).
    assert (LD : forall k l, length (diagf k l) = length l) by (clear; intros k l; revert k; induction l; intros; simpl; auto).
    assert (LM : forall A B : mat, (length A <= length (madd A B))%nat).
    { clear. induction A as [|r A IH]; intros B; simpl; [lia|]. destruct B; simpl; [lia|]. specialize (IH B). lia. }
    assert (Pn : (length p <= n)%nat).
    { rewrite <- Lp. rewrite <- (LD 0%nat pz). pose proof (LM (mscale t (diagf 0 pz)) (mscale (-1) (outer h h))) as Q.
      unfold mscale at 1 in Q. rewrite map_length in Q. unfold n in *. lia. }
    split; [exact K4|]. split; [exact He|]. split; [|split; [rewrite LD; lia|]].
    { assert (Q : forall l k, List.Forall (fun r : vec => (length r <= k + length l)%nat) (diagf k l)).
      { clear. induction l as [|a l IH]; intros k; simpl; [constructor|]. constructor.
        - rewrite unit_len. lia.
        - specialize (IH (S k)). eapply List.Forall_impl; [|exact IH]. intros r Hr. simpl in *. lia. }
      specialize (Q pz 0%nat). unfold rows_le. eapply List.Forall_impl; [|exact Q]. intros r Hr. simpl in Hr. lia. }
    intros x _. cbn [V coords]. rewrite bil_diagf. cbn [Nat.add].
    assert (Ht : 0 < IZR t) by (apply IZR_lt; exact K4). apply IZR_lt in He.
    assert (Q1 : IZR t = IZR e * qdot p (fun _ => 1)) by (unfold t; rewrite <- dot_one; apply dot_scaled; exact K1).
    assert (Qh : dot h x = IZR e * qdot p (fun i => sgn g i * x i)).
    { unfold h. rewrite dot_hadamard by lia. unfold pz. rewrite dot_scaled by exact K1. reflexivity. }
    set (rows := map _ (seq 0 (order c))).
    assert (R : forall i, (i < n)%nat -> dot (nth i rows []) x = IZR t * (x i - mean p g x * sgn g i)).
    { intros i Hi. unfold rows. rewrite nth_map_seq by exact Hi. rewrite dot_vadd, dot_unit, dot_scale, opp_IZR, Qh. unfold mean, sgn.
      rewrite Q1. field. intros Z. rewrite Z, Rmult_0_r in Q1. lra. }
    rewrite (dot_ext pz _ (fun i => IZR t * IZR t * sq (x i - mean p g x * sgn g i))).
    2: { intros i Hi. rewrite R by (unfold n in *; lia). unfold sq. ring. }
    rewrite dot_scal. unfold pz. rewrite (dot_scaled e p K1). field. lra.
Qed.

(** what drives the coordinates: shares of [C], within a bound *)
Variables (A : mat) (u : Z) (P : mat) (e : Z) (C : vec).
Hypothesis HA : rows_of c d f = (A, u, P, e).
Let w := IZR (sizes P (map (sided C) A)).
Lemma entry_ok M x i : 0 <= M -> (forall j, exists a, 0 <= a <= M /\ x j = - (a * IZR (nth j C 0%Z))) ->
  Rabs (dot (nth i A []) x) <= IZR (nth i (map (sided C) A) 0%Z) * M.
Proof. intros HM H. rewrite nth_sided. apply (sided_ok M HM). intros j _. apply H. Qed.
Lemma sizes_pos : 0 <= w.
Proof.
  destruct (rows_ok A u P e HA) as [_ [_ [P1 [P2 _]]]]. set (z := fun i => dot (nth i A []) (fun _ => 0)).
  assert (Z : forall i, Rabs (z i) <= IZR (nth i (map (sided C) A) 0%Z) * 1).
  { intros i. apply entry_ok; [lra|]. intros j. exists 0. split; [lra|ring]. }
  pose proof (bil_sizes n (map (sided C) A) z 1 Rle_0_1 (fun i _ => Z i) P z (map (sided C) A) P1 (fun i _ => Z i)) as B.
  pose proof (Rabs_pos (bil P z z)). fold (sizes P (map (sided C) A)) in B. fold w in B. lra.
Qed.
Lemma driven_by q M x : 0 <= q -> 0 <= M -> (forall i, (i < n)%nat -> exists a, 0 <= a <= M /\ x i = - (a * IZR (nth i C 0%Z))) ->
  w / (IZR e * (IZR u * IZR u)) <= q * q -> sqrt (V es (ly f) x) <= M * q.
Proof.
  intros Hq HM H HS. destruct (rows_ok A u P e HA) as [Hu [He [P1 [P2 HV]]]]. apply IZR_lt in Hu, He.
  set (x' := fun i => if lt_dec i n then x i else 0).
  rewrite (V_same x x') by (intros i Hi; unfold x'; destruct (lt_dec i n); [reflexivity|contradiction]).
  rewrite HV by (intros i Hi; unfold x'; destruct (lt_dec i n); [lia|reflexivity]).
  set (z := fun i => dot (nth i A []) x').
  assert (Z : forall i, Rabs (z i) <= IZR (nth i (map (sided C) A) 0%Z) * M).
  { intros i. apply entry_ok; [exact HM|]. intros j. unfold x'. destruct (lt_dec j n) as [L|L]; [apply H; exact L|].
    exists 0. split; [lra|ring]. }
  pose proof (bil_sizes n (map (sided C) A) z M HM (fun i _ => Z i) P z (map (sided C) A) P1 (fun i _ => Z i)) as B.
  fold (sizes P (map (sided C) A)) in B. fold w in B. pose proof (Rle_abs (bil P z z)) as B2.
  assert (D : 0 < IZR e * (IZR u * IZR u)) by (apply Rmult_lt_0_compat; [exact He|apply Rmult_lt_0_compat; exact Hu]).
  assert (Mq : 0 <= M * q) by (apply Rmult_le_pos; assumption).
  rewrite <- (sqrt_square (M * q) Mq). apply sqrt_le_1_alt.
  apply Rle_trans with (M * M * (w / (IZR e * (IZR u * IZR u)))).
  - replace (M * M * (w / (IZR e * (IZR u * IZR u)))) with (w * (M * M) / (IZR e * (IZR u * IZR u))) by (unfold Rdiv; ring).
    apply Rmult_le_compat_r; [left; apply Rinv_0_lt_compat; exact D|]. lra.
  - replace (M * q * (M * q)) with (M * M * (q * q)) by ring. apply Rmult_le_compat_l; [apply Rle_0_sqr|exact HS].
Qed.
End Rows.

(** * Along a motion *)
Section Course.
Variables (c : cert) (T_r T_s mu1 mu2 mu3 delta : Q).
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hkind : kind c = SlidingMode T_r T_s mu1 mu2 mu3 delta.
Let d := prepare c.
Let n := order c.
Let es := edges c.
Let T := deadline c.
Hypothesis Hls : good (dls d) (map wt es) = true.
Hypothesis Gs : good (common (sliding c)) (sliding c) = true.
Variables (X S : R -> nat -> R).
Hypothesis HM : moves c X S.
Hypothesis S0 : forall i, (i < n)%nat -> S 0 i = Q2R (nth i (sliding c) 0%Q).
Variables (f : func) (F : mat) (m : Z).
Hypothesis HF : form n (dls d) (dL d) (ly f) = Some (F, m).
Hypothesis Hr : 0 < Q2R (rate f).
Hypothesis V0 : forall x, 0 <= V es (ly f) x.
Hypothesis Hdecay : forall x, Q2R (rate f) * bil F x x <= bil F (lap es x) x + bil F x (lap es x).
Hypothesis Hrest : forall t0 t, moves_from c X S t0 -> t0 <= t < T ->
  V es (ly f) (X t) <= exp (- (Q2R (rate f) * (s c t - s c t0))) * V es (ly f) (X t0).
Let U x := sqrt (V es (ly f) x).
Let push := (mu1 + delta)%Q.
Let ww := fst (pushed c d push f).
Let ff := snd (pushed c d push f).
Let push_pos : 0 < Q2R push.
Proof.
  destruct (parts c T_r T_s mu1 mu2 mu3 delta Hprot Hkind) as [_ [A _]].
  pose proof (delta_pos c T_r T_s mu1 mu2 mu3 delta Hprot Hkind). unfold push. rewrite Q2R_plus. lra.
Qed.
Lemma shares_ok : 0 <= Q2R ww /\ forall M x, 0 <= M ->
  (forall i, (i < n)%nat -> exists a, 0 <= a <= M /\ x i = - (a * S 0 i)) -> U x <= M * Q2R ww.
Proof.
  unfold ww, pushed. destruct (rows_of c d f) as [[[A u] P] e] eqn:E. cbv zeta. cbn [fst].
  destruct (rows_ok c f F m Hls HF A u P e E) as [Hu [He _]]. destruct (good_ok _ _ Gs) as [Hb _].
  set (b := common (sliding c)) in *. set (C := map (scaled b) (sliding c)).
  pose proof (sizes_pos c f F m Hls HF A u P e C E) as W0. set (w := sizes P (map (sided C) A)) in *.
  set (q := (inject_Z w / inject_Z (e * (u * u) * (b * b)))%Q).
  assert (Eq : Q2R q = IZR w / (IZR e * (IZR u * IZR u) * (IZR b * IZR b))).
  { unfold q. rewrite Q2R_div, !Q2R_inject, !mult_IZR by (unfold Qeq; cbn [Qnum Qden inject_Z]; nia). reflexivity. }
  apply IZR_lt in Hu, He, Hb.
  assert (D : 0 < IZR e * (IZR u * IZR u) * (IZR b * IZR b)) by (repeat apply Rmult_lt_0_compat; assumption).
  assert (Q0 : 0 <= Q2R q) by (rewrite Eq; apply Rmult_le_pos; [exact W0|left; apply Rinv_0_lt_compat; exact D]).
  destruct (root_ok q Q0) as [R0 R1]. split; [exact R0|]. intros M x HM0 H.
  replace (M * Q2R (root q)) with (M / IZR b * (IZR b * Q2R (root q))) by (field; lra).
  apply (driven_by c f F m Hls HF A u P e C E).
  - apply Rmult_le_pos; lra.
  - apply Rmult_le_pos; [exact HM0|left; apply Rinv_0_lt_compat; exact Hb].
  - intros i Hi. destruct (H i Hi) as [a [Ha Ex]]. exists (a / IZR b). split.
    + pose proof (Rinv_0_lt_compat _ Hb). unfold Rdiv. split; [apply Rmult_le_pos; lra|apply Rmult_le_compat_r; lra].
    + rewrite Ex, S0 by exact Hi. unfold C. rewrite (nth_scaled b (sliding c) i Gs). field. lra.
  - fold w. unfold sq in R1. rewrite Eq in R1. apply (Rmult_le_compat_l (IZR b * IZR b)) in R1; [|apply Rle_0_sqr].
    replace (IZR b * IZR b * (IZR w / (IZR e * (IZR u * IZR u) * (IZR b * IZR b)))) with (IZR w / (IZR e * (IZR u * IZR u))) in R1 by (field; lra).
    lra.
Qed.
Lemma signs_ok : 0 <= Q2R ff /\ forall M x, 0 <= M ->
  (forall i, (i < n)%nat -> exists b, 0 <= b <= M * (Q2R mu1 + Q2R delta) /\ x i = - (b * sign (S 0 i))) -> U x <= M * Q2R ff.
Proof.
  unfold ff, pushed. destruct (rows_of c d f) as [[[A u] P] e] eqn:E. cbv zeta. cbn [snd].
  destruct (rows_ok c f F m Hls HF A u P e E) as [Hu [He _]]. set (C := start_signs c).
  pose proof (sizes_pos c f F m Hls HF A u P e C E) as W0. set (w := sizes P (map (sided C) A)) in *.
  set (q := (inject_Z w / inject_Z (e * (u * u)))%Q).
  assert (Eq : Q2R q = IZR w / (IZR e * (IZR u * IZR u))).
  { unfold q. rewrite Q2R_div, !Q2R_inject, !mult_IZR by (unfold Qeq; cbn [Qnum Qden inject_Z]; nia). reflexivity. }
  apply IZR_lt in Hu, He.
  assert (D : 0 < IZR e * (IZR u * IZR u)) by (repeat apply Rmult_lt_0_compat; assumption).
  assert (Q0 : 0 <= Q2R q) by (rewrite Eq; apply Rmult_le_pos; [exact W0|left; apply Rinv_0_lt_compat; exact D]).
  destruct (root_ok q Q0) as [R0 R1]. rewrite Q2R_mult. split; [apply Rmult_le_pos; lra|]. intros M x HM0 H.
  replace (M * (Q2R push * Q2R (root q))) with (M * Q2R push * Q2R (root q)) by ring.
  apply (driven_by c f F m Hls HF A u P e C E).
  - exact R0.
  - apply Rmult_le_pos; lra.
  - intros i Hi. destruct (H i Hi) as [a [Ha Ex]]. exists a. split; [unfold push; rewrite Q2R_plus; exact Ha|].
    rewrite Ex, S0, sign_ok by exact Hi. unfold C, start_signs. f_equal. f_equal.
    change 0%Z with ((fun q => Z.sgn (Qnum q)) 0%Q). rewrite map_nth. reflexivity.
  - fold w. unfold sq in R1. rewrite Eq in R1. exact R1.
Qed.
Lemma root_falls t0 t : moves_from c X S t0 -> t0 <= t < T -> U (X t) <= exp (- (Q2R (rate f) / 2 * (s c t - s c t0))) * U (X t0).
Proof.
  intros HQ Ht. pose proof (Hrest t0 t HQ Ht) as D. unfold U. set (x := exp (- (Q2R (rate f) / 2 * (s c t - s c t0)))).
  assert (Px : 0 < x) by apply exp_pos.
  assert (EE : exp (- (Q2R (rate f) * (s c t - s c t0))) = x * x) by (unfold x; rewrite <- exp_plus; f_equal; field).
  rewrite EE in D. rewrite <- (sqrt_square x) by lra. rewrite <- sqrt_mult_alt by (apply Rle_0_sqr). apply sqrt_le_1_alt. exact D.
Qed.
Lemma root_driven a t : 0 <= a <= t -> t < T -> U (X t) <= exp (- (Q2R (rate f) / 2 * (s c t - s c a))) * U (X a)
  + Q2R ww * (left_of c T_r mu2 mu3 a - left_of c T_r mu2 mu3 t) + Q2R ff * (t - a).
Proof.
  destruct (form_ok n _ _ _ _ _ _ Hls eq_refl HF) as [Hm [HFt HV]]. destruct (fits_ok _ _ HFt) as [F1 F2]. apply IZR_lt in Hm.
  assert (HV' : forall x, bil F x x / IZR m = V es (ly f) x) by (intros x; rewrite HV; field; lra).
  destruct (measure_size es n (ly f) F (IZR m) Hm F2 F1 HV' V0) as [K [K0 HK]].
  destruct shares_ok as [W0 W1]. destruct signs_ok as [G0 G1].
  apply (driven_on c T_r T_s mu1 mu2 mu3 delta Hprot Hkind X S HM U (Q2R (rate f)) K (Q2R ww) (Q2R ff)); auto; try lra.
  - intros x. apply sqrt_pos.
  - intros x y. apply (measure_plus es (ly f) F (IZR m) Hm HV' V0).
  - intros x. apply (measure_falls es (ly f) F (IZR m) (Q2R (rate f)) Hm Hr HV' V0 Hdecay).
  - exact root_falls.
Qed.

(** * What is known of a function *)
Hypothesis Hreach : check_reaching c = true.
Hypothesis V_start : forall v cs cn, bounds_of c d f = Some (v, cs, cn) -> Q2R v = V es (ly f) (X 0) /\
  (forall x i, (i < n)%nat -> sq (lap es x i) <= Q2R (nth i cs 0%Q) * V es (ly f) x) /\
  forall x, norm2 n (lap es x) <= Q2R cn * V es (ly f) x.
Lemma rested_ok t u i : rested c T_r t = true -> 0 <= Q2R t -> Q2R t <= u < T -> (i < n)%nat -> S u i = 0.
Proof.
  intros H Ht Hu Hi. unfold rested in H. apply orb_prop in H as [H|H].
  - apply Qle_ok in H. apply (rests c T_r T_s mu1 mu2 mu3 delta Hprot Hkind X S i HM Hi). fold T. lra.
  - rewrite forallb_forall in H. specialize (H i ltac:(apply in_seq; unfold n in Hi; lia)).
    destruct (parts c T_r T_s mu1 mu2 mu3 delta Hprot Hkind) as [A _]. apply orb_prop in H as [H|H].
    + apply (Reach.stays_0 c T_r T_s mu1 mu2 mu3 delta Hprot Hkind X S i HM Hi 0 u); [lra|exact (proj2 Hu)|].
      apply Qeq_bool_eq, Qeq_eqR in H. rewrite S0, H by exact Hi. apply Q2R_0.
    + destruct (nth i (reaching c) None) as [z|] eqn:Ez; [|discriminate]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
      apply negb_true_iff in H2. apply notneg_Q in H1. apply Qle_ok in H3. pose proof (above_ok z H1 H2) as B.
      assert (L : (i < length (reaching c))%nat).
      { destruct (Nat.lt_ge_cases i (length (reaching c))) as [L|L]; [exact L|]. rewrite nth_overflow in Ez by exact L. discriminate. }
      assert (HA : arrives c T_r mu1 mu2 mu3 delta (nth i (sliding c) 0%Q) z = true).
      { unfold check_reaching in Hreach. rewrite Hkind in Hreach. rewrite forallb_forall in Hreach.
        specialize (Hreach i ltac:(apply in_seq; lia)). rewrite Ez in Hreach. exact Hreach. }
      apply (reaching_part c T_r T_s mu1 mu2 mu3 delta Hprot Hkind X S i HM Hi z u HA (S0 i Hi)). split; [|exact (proj2 Hu)].
      eapply Rle_trans; [|exact (proj1 Hu)]. eapply Rle_trans; [|exact H3]. pose proof (exp_pos (Q2R z)) as Pz.
      rewrite Q2R_mult, Q2R_minus, Q2R_1, Q2R_inv by (apply nonzero; lra). apply Rmult_le_compat_l; [lra|].
      assert (/ Q2R (Checker.above z) <= exp (- Q2R z)); [|lra]. rewrite exp_Ropp. apply Rinv_le_contravar; lra.
Qed.
Let Ut t := U (X t).
Lemma known_ok z l k : all_instants c z = Some l -> known_of c d push l f = Some k ->
  let o := at_last k in let te := Q2R (time o) in
  rate_of k = rate f /\ stands c T_r mu2 mu3 o /\ covers c Ut (rate f) (fst (in_pieces k)) 0 te /\ Ut te <= Q2R (snd (in_pieces k)) /\
  (forall t, te <= t < T -> Ut t <= exp (- (Q2R (rate f) / 2 * (s c t - s c te))) * Ut te) /\
  (0 <= Q2R (norm_root k) /\ forall x, sqrt (norm2 n (lap es x)) <= Q2R (norm_root k) * U x) /\
  forall i, (i < n)%nat -> 0 <= Q2R (nth i (each_root k) 0%Q) /\ forall x, Rabs (lap es x i) <= Q2R (nth i (each_root k) 0%Q) * U x.
Proof.
  unfold all_instants, known_of. rewrite Hkind. intros HI HK.
  destruct (instants T_r T_s mu2 (mu3 * kappa c) z 16) as [l'|] eqn:EI; [|discriminate]. cbv zeta in HI.
  destruct (_ && _ && _) eqn:EA in HI; [|discriminate]. injection HI as ->.
  apply andb_prop in EA as [EA E3]. apply andb_prop in EA as [E1 E2].
  destruct (instants_ok c T_r T_s mu1 mu2 mu3 delta Hprot Hkind z 16 l EI) as [NE ST].
  destruct (bounds_of c d f) as [[[v cs] cn]|] eqn:EB; [|discriminate]. destruct (V_start v cs cn eq_refl) as [EV [Hc Hn]].
  cbv zeta in HK. destruct (_ && _ && _ && _) eqn:EK in HK; [|discriminate]. apply andb_prop in EK as [EK K4].
  apply andb_prop in EK as [EK K3]. apply andb_prop in EK as [_ K2]. injection HK as <-. apply notneg_Q in K2, K3.
  set (o0 := Instant 0 1 (0%Q, 0%Q) (0%Q, 0%Q)) in *. cbn [at_last in_pieces rate_of each_root norm_root]. cbv zeta.
  destruct l as [|a l]; [contradiction|]. cbn [hd] in E1. apply Qeq_bool_eq, Qeq_eqR in E1. rewrite Q2R_0 in E1.
  assert (HL : stands c T_r mu2 mu3 (List.last (a :: l) o0)).
  { apply ST. clear. generalize a. induction l as [|b l IH]; intros a'; [left; reflexivity|]. right. apply (IH b). }
  destruct (root_ok v K2) as [R0 R1].
  assert (UV : Ut (Q2R (time a)) <= Q2R (root v)).
  { rewrite E1. unfold Ut, U. rewrite <- EV. rewrite <- (sqrt_square _ R0). apply sqrt_le_1_alt. exact R1. }
  destruct shares_ok as [W0 _]. destruct signs_ok as [G0 _]. fold ww ff.
  destruct (run_ok c T_r T_s mu1 mu2 mu3 delta Hprot Hkind Ut (rate f) ww ff Hr W0 G0 (fun t => sqrt_pos _)
    (fun a t Ha Hu => root_driven a t Ha Hu) l a (root v) ST E2 UV o0) as [C1 C2].
  rewrite E1 in C1. pose proof HL as [HT0 _]. fold T in HT0.
  split; [reflexivity|]. split; [exact HL|]. split; [exact C1|]. split; [exact C2|]. split; [|split].
  - intros t Ht. assert (MF : moves_from c X S (Q2R (time (List.last (a :: l) o0)))).
    { split; [exact HM|]. split; [exact HT0|]. intros u i Hu Hi. apply (rested_ok _ u i E3); [lra|exact Hu|exact Hi]. }
    exact (root_falls _ t MF Ht).
  - destruct (root_ok cn K3) as [N0 N1]. split; [exact N0|]. intros x. unfold U.
    rewrite <- (sqrt_square _ N0), <- sqrt_mult_alt by (apply Rle_0_sqr). apply sqrt_le_1_alt.
    eapply Rle_trans; [apply Hn|]. apply Rmult_le_compat_r; [apply V0|exact N1].
  - intros i Hi. assert (EN : nth i (map root cs) 0%Q = root (nth i cs 0%Q) \/ nth i cs 0%Q = 0%Q /\ nth i (map root cs) 0%Q = 0%Q).
    { destruct (Nat.lt_ge_cases i (length cs)) as [L|L].
      - left. rewrite nth_indep with (d' := root 0%Q) by (rewrite map_length; exact L). apply map_nth.
      - right. split; apply nth_overflow; [exact L|rewrite map_length; exact L]. }
    assert (C0 : 0 <= Q2R (nth i cs 0%Q)).
    { rewrite forallb_forall in K4. destruct (nth_in_or_default i cs 0%Q) as [I|I]; [apply notneg_Q; apply K4; exact I|]. rewrite I, Q2R_0. lra. }
    assert (B : 0 <= Q2R (nth i (map root cs) 0%Q) /\ Q2R (nth i cs 0%Q) <= sq (Q2R (nth i (map root cs) 0%Q))).
    { destruct EN as [->|[-> ->]]; [apply root_ok; exact C0|]. rewrite Q2R_0. unfold sq. lra. }
    destruct B as [N0 N1]. split; [exact N0|]. intros x. unfold U.
    rewrite <- (sqrt_square _ N0), <- sqrt_mult_alt by (apply Rle_0_sqr). rewrite <- sqrt_Rsqr_abs. apply sqrt_le_1_alt.
    eapply Rle_trans; [apply (Hc x i Hi)|]. apply Rmult_le_compat_r; [apply V0|exact N1].
Qed.
End Course.

(** * Path length, energy, and how large the input gets *)
Lemma norm_sum n x y : sqrt (norm2 n (fun i => x i + y i)) <= sqrt (norm2 n x) + sqrt (norm2 n y).
Proof. rewrite <- !bil_ones. apply root_plus. intros z. rewrite bil_ones. apply norm2_pos. Qed.
Lemma norm_below n x y : (forall i, (i < n)%nat -> Rabs (x i) <= y i) -> sqrt (norm2 n x) <= sqrt (norm2 n y).
Proof.
  intros H. apply sqrt_le_1_alt. unfold norm2. assert (K : forall i, In i (seq 0 n) -> Rabs (x i) <= y i) by (intros i Hi; apply in_seq in Hi; apply H; lia).
  induction (seq 0 n) as [|i l IH]; simpl; [lra|]. apply Rplus_le_compat; [|apply IH; intros j Hj; apply K; right; exact Hj].
  specialize (K i (or_introl eq_refl)). pose proof (Rabs_pos (x i)). unfold sq. rewrite <- (Rabs_right (x i * x i)) by (apply Rle_ge, Rle_0_sqr).
  rewrite Rabs_mult. apply Rmult_le_compat; lra.
Qed.
Lemma norm_sizes n x : sqrt (norm2 n (fun i => Rabs (x i))) = sqrt (norm2 n x).
Proof.
  f_equal. unfold norm2. f_equal. apply FunctionalExtensionality.functional_extensionality. intros i.
  apply FunctionalExtensionality.functional_extensionality. intros a. f_equal. unfold sq. rewrite <- Rabs_mult.
  apply Rabs_right, Rle_ge, Rle_0_sqr.
Qed.
Lemma norm_same n a : norm2 n (fun _ => a) = IZR (Z.of_nat n) * (a * a).
Proof.
  unfold norm2. generalize 0%nat. induction n as [|n IH]; intros k; cbn [seq fold_right]; [rewrite Rmult_0_l; reflexivity|].
  rewrite IH, Nat2Z.inj_succ, succ_IZR. unfold sq. ring.
Qed.
Lemma norm_root_ok n (q : nat -> Q) : sqrt (norm2 n (fun i => Q2R (q i))) <= Q2R (root (fold_right (fun i a => q i * q i + a) 0 (seq 0 n))%Q).
Proof.
  assert (E : Q2R (fold_right (fun i a => q i * q i + a) 0 (seq 0 n))%Q = norm2 n (fun i => Q2R (q i))).
  { unfold norm2. induction (seq 0 n) as [|i l IH]; cbn [fold_right]; [apply Q2R_0|]. rewrite Q2R_plus, Q2R_mult, IH. reflexivity. }
  destruct (root_ok (fold_right (fun i a => q i * q i + a) 0 (seq 0 n))%Q) as [R0 R1]; [rewrite E; apply norm2_pos|].
  rewrite <- (sqrt_square _ R0). apply sqrt_le_1_alt. rewrite E in R1. exact R1.
Qed.

Lemma norm_list_ok l : sqrt (norm2 (length l) (fun i => Q2R (nth i l 0%Q))) <= Q2R (root (fold_right (fun q a => q * q + a) 0 l)%Q).
Proof.
  assert (E : Q2R (fold_right (fun q a => q * q + a) 0 l)%Q = norm2 (length l) (fun i => Q2R (nth i l 0%Q))).
  { induction l as [|q l IH]; cbn [fold_right length]; [apply Q2R_0|]. rewrite norm2_shift, Q2R_plus, Q2R_mult, IH. reflexivity. }
  destruct (root_ok (fold_right (fun q a => q * q + a) 0 l)%Q) as [R0 R1]; [rewrite E; apply norm2_pos|].
  rewrite <- (sqrt_square _ R0). apply sqrt_le_1_alt. rewrite E in R1. exact R1.
Qed.

Section Efforts.
Variables (c : cert) (T_r T_s mu1 mu2 mu3 delta : Q).
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hkind : kind c = SlidingMode T_r T_s mu1 mu2 mu3 delta.
Let d := prepare c.
Let n := order c.
Let es := edges c.
Let T := deadline c.
Hypothesis Hls : good (dls d) (map wt es) = true.
Hypothesis Hsrc : forall e, In e es -> (src e < n)%nat.
Hypothesis Hfit : fits n (dL d) = true.
Hypothesis Gs : good (common (sliding c)) (sliding c) = true.
Hypothesis Gx : good (common (start c)) (start c) = true.
Hypothesis Hreach : check_reaching c = true.
Hypothesis HFs : forall f, In f (funcs c) -> exists F m, form n (dls d) (dL d) (ly f) = Some (F, m) /\
  (forall x, Q2R (rate f) * bil F x x <= bil F (lap es x) x + bil F x (lap es x)) /\
  check_ends c d f = true /\ check_constants c d f = true /\ decay_claim c f.
Variables (X S : R -> nat -> R).
Hypothesis HM : moves c X S.
Hypothesis X0 : forall i, (i < n)%nat -> X 0 i = Q2R (nth i (start c) 0%Q).
Hypothesis S0 : forall i, (i < n)%nat -> S 0 i = Q2R (nth i (sliding c) 0%Q).
Let push := (mu1 + delta)%Q.
Lemma way_known z j k : nth_error (known_at c d push z) j = Some (Some k) -> exists U : R -> R,
  let o := at_last k in let te := Q2R (time o) in 0 < Q2R (rate_of k) /\ (forall t, 0 <= U t) /\
  stands c T_r mu2 mu3 o /\ covers c U (rate_of k) (fst (in_pieces k)) 0 te /\ U te <= Q2R (snd (in_pieces k)) /\
  (forall t, te <= t < T -> U t <= exp (- (Q2R (rate_of k) / 2 * (s c t - s c te))) * U te) /\
  (0 <= Q2R (norm_root k) /\ forall t, sqrt (norm2 n (lap es (X t))) <= Q2R (norm_root k) * U t) /\
  forall i, (i < n)%nat -> 0 <= Q2R (nth i (each_root k) 0%Q) /\ forall t, Rabs (lap es (X t) i) <= Q2R (nth i (each_root k) 0%Q) * U t.
Proof.
  intros H. unfold known_at in H. destruct (all_instants c z) as [l|] eqn:EI; [|destruct j; discriminate].
  apply nth_error_In, in_map_iff in H as [f [EK Hf]]. destruct (HFs f Hf) as [F [m [HF [HD [HE [HC HV]]]]]].
  assert (Hr : 0 < Q2R (rate f)).
  { unfold known_of in EK. destruct (bounds_of c d f) as [[[v cs] cn]|]; [|discriminate]. cbv zeta in EK.
    destruct (_ && _ && _ && _) eqn:E in EK; [|discriminate]. apply andb_prop in E as [E _]. apply andb_prop in E as [E _].
    apply andb_prop in E as [E _]. apply pos_Q. exact E. }
  assert (V0 : forall x, 0 <= V es (ly f) x).
  { intros x. destruct (ends_ok c f HE) as [L0 [L1 _]]. specialize (L1 x). eapply Rle_trans; [|exact L1].
    apply Rmult_le_pos; [lra|apply norm2_pos]. }
  assert (Hrest : forall t0 t, moves_from c X S t0 -> t0 <= t < T ->
    V es (ly f) (X t) <= exp (- (Q2R (rate f) * (s c t - s c t0))) * V es (ly f) (X t0)).
  { intros t0 t HQ Ht. exact (proj1 (HV X S t0 t HQ Ht)). }
  pose proof (fun v cs cn => bounds_ok c Hls Hsrc Hfit Gx (X 0) X0 f v cs cn HC HE) as HB.
  pose proof (known_ok c T_r T_s mu1 mu2 mu3 delta Hprot Hkind Hls Gs X S HM S0 f F m HF Hr V0 HD Hrest Hreach HB z l k EI EK) as K.
  cbv zeta in K. destruct K as [ER [K1 [K2 [K3 [K4 [[K5 K6] K7]]]]]]. exists (fun t => sqrt (V es (ly f) (X t))). cbv zeta. rewrite ER.
  split; [exact Hr|]. split; [intros t; apply sqrt_pos|]. split; [exact K1|]. split; [exact K2|]. split; [exact K3|]. split; [exact K4|].
  split; [split; [exact K5|intros t; apply K6]|]. intros i Hi. destruct (K7 i Hi) as [Q1 Q2]. split; [exact Q1|intros t; apply Q2].
Qed.
Let Y (u : R) : nat -> R := X (Rmax 0 u).
Let positive3 := Driven.positive c T_r T_s mu1 mu2 mu3 delta Hprot Hkind.
Lemma from_0 (H : R -> R) t : (forall u, u < T -> continuous H u) -> 0 <= t < T -> ex_RInt H 0 t.
Proof.
  intros C Ht. apply (ex_RInt_continuous (V := R_CompleteNormedModule)). intros z Hz. apply C. rewrite Rmax_right in Hz by lra. lra.
Qed.
Lemma root_power u : 0 <= u < T -> sqrt (norm2 n (input c Y u)) = gain T (Q2R (rho1 c)) (k c) u * sqrt (norm2 n (lap es (X u))).
Proof.
  intros Hu. destruct positive3 as [P1 [P2 P3]]. rewrite (power_eq c X) by lra. fold n es T.
  assert (G : 0 < gain T (Q2R (rho1 c)) (k c) u) by (apply gain_pos; lra).
  rewrite sqrt_mult_alt by apply sq_pos. unfold sq. rewrite sqrt_square by lra. reflexivity.
Qed.
Let bounds := never_above c d push T_r.
Let bound := root (fold_right (fun q a => q * q + a) 0 bounds)%Q.
Lemma each_bounded u i : 0 <= u < T -> (i < n)%nat -> Rabs (lap es (X u) i) <= Q2R (nth i bounds 0%Q).
Proof. intros Hu Hi. apply (never_ok c T_r T_s mu1 mu2 mu3 delta Hprot Hkind Hls Hfit Hsrc Gs Gx X S HM X0 S0 i u Hi Hu). Qed.
Lemma norm_bounded u : 0 <= u < T -> sqrt (norm2 n (lap es (X u))) <= Q2R bound.
Proof.
  intros Hu. assert (L : length bounds = n) by (unfold bounds, never_above; cbv zeta; rewrite map_length; apply len_dL).
  eapply Rle_trans; [|apply norm_list_ok]. rewrite L. apply norm_below. intros i Hi. apply each_bounded; assumption.
Qed.
Lemma length_spent z j kn q t : nth_error (known_at c d push z) j = Some (Some kn) ->
  length_moving q bound (norm_root kn) (in_pieces kn) (rate_of kn) = true -> 0 <= t < T ->
  ex_RInt (fun u => sqrt (norm2 n (input c X u))) 0 t /\ RInt (fun u => sqrt (norm2 n (input c X u))) 0 t <= Q2R q.
Proof.
  intros HK HL Ht. destruct (way_known z j kn HK) as [U [Hr [U0 [K1 [K2 [K3 [K4 [[K5 K6] _]]]]]]]]. destruct (in_pieces kn) as [l y].
  apply (back c X sqrt); [lra|]. fold n Y. assert (C : forall u, u < T -> continuous (fun u => sqrt (norm2 n (input c Y u))) u).
  { intros u Hu. apply continuous_sqrt_comp. apply (power_cont c X S Hsrc HM). exact Hu. }
  split; [apply from_0; assumption|].
  apply (length_ok c T_r T_s mu1 mu2 mu3 delta Hprot Hkind U (rate_of kn) (norm_root kn) l y (at_last kn) Hr K5 U0 K1 K2 K3 K4
    (fun t => sqrt (norm2 n (lap es (X t))))) with (A := bound); [|exact norm_bounded|exact C| |exact HL|exact Ht].
  - intros u Hu. split; [apply sqrt_pos|apply K6].
  - intros u Hu. apply root_power. exact Hu.
Qed.
Lemma energy_spent z j kn q t : nth_error (known_at c d push z) j = Some (Some kn) ->
  energy_moving c q bound (norm_root kn) (at_last kn) (in_pieces kn) (rate_of kn) = true -> 0 <= t < T ->
  ex_RInt (fun u => norm2 n (input c X u)) 0 t /\ RInt (fun u => norm2 n (input c X u)) 0 t <= Q2R q.
Proof.
  intros HK HL Ht. destruct (way_known z j kn HK) as [U [Hr [U0 [K1 [K2 [K3 [K4 [[K5 K6] _]]]]]]]]. destruct (in_pieces kn) as [l y].
  apply (back c X (fun x => x)); [lra|]. fold n Y. assert (C : forall u, u < T -> continuous (fun u => norm2 n (input c Y u)) u).
  { intros u Hu. apply (power_cont c X S Hsrc HM). exact Hu. }
  split; [apply from_0; assumption|].
  apply (energy_ok c T_r T_s mu1 mu2 mu3 delta Hprot Hkind U (rate_of kn) (norm_root kn) l y (at_last kn) Hr K5 U0 K1 K2 K3 K4
    (fun t => sqrt (norm2 n (lap es (X t))))) with (A := bound); [|exact norm_bounded|exact C| |exact HL|exact Ht].
  - intros u Hu. split; [apply sqrt_pos|apply K6].
  - intros u Hu. fold T. rewrite <- root_power by exact Hu. unfold sq. rewrite sqrt_sqrt by apply norm2_pos. reflexivity.
Qed.
(** the nominal part of the input *)
Lemma peak_each z j kn q i t : nth_error (known_at c d push z) j = Some (Some kn) -> (i < n)%nat ->
  peak_moving c q (nth i bounds 0%Q) (nth i (each_root kn) 0%Q) (at_last kn) (in_pieces kn) (rate_of kn) = true -> 0 <= t < T ->
  Rabs (input c X t i) <= Q2R q.
Proof.
  intros HK Hi HL Ht. destruct (way_known z j kn HK) as [U [Hr [U0 [K1 [K2 [K3 [K4 [_ K]]]]]]]]. destruct (K i Hi) as [K5 K6].
  destruct (in_pieces kn) as [l y]. destruct positive3 as [P1 [P2 P3]].
  assert (G : 0 < gain T (Q2R (rho1 c)) (k c) t) by (apply gain_pos; lra).
  unfold input. rewrite Rabs_Ropp, Rabs_mult, Rabs_right by (fold T; lra).
  apply (peak_ok c T_r T_s mu1 mu2 mu3 delta Hprot Hkind U (rate_of kn) (nth i (each_root kn) 0%Q) l y (at_last kn) K5 U0 K1 K2 K3 K4
    (fun t => Rabs (lap es (X t) i))) with (A := nth i bounds 0%Q); [|intros u Hu; apply each_bounded; assumption|exact HL|exact Ht].
  intros u Hu. split; [apply Rabs_pos|apply K6].
Qed.
Lemma peak_norm z j kn q t : nth_error (known_at c d push z) j = Some (Some kn) ->
  peak_moving c q bound (norm_root kn) (at_last kn) (in_pieces kn) (rate_of kn) = true -> 0 <= t < T ->
  sqrt (norm2 n (input c X t)) <= Q2R q.
Proof.
  intros HK HL Ht. destruct (way_known z j kn HK) as [U [Hr [U0 [K1 [K2 [K3 [K4 [[K5 K6] _]]]]]]]]. destruct (in_pieces kn) as [l y].
  assert (E : sqrt (norm2 n (input c X t)) = sqrt (norm2 n (input c Y t))).
  { unfold input, Y. rewrite Rmax_right by lra. reflexivity. }
  rewrite E, root_power by exact Ht.
  apply (peak_ok c T_r T_s mu1 mu2 mu3 delta Hprot Hkind U (rate_of kn) (norm_root kn) l y (at_last kn) K5 U0 K1 K2 K3 K4
    (fun t => sqrt (norm2 n (lap es (X t))))) with (A := bound); [|exact norm_bounded|exact HL|exact Ht].
  intros u Hu. split; [apply sqrt_pos|apply K6].
Qed.
Lemma moving_ok e t : check_moving c d e = true -> 0 <= t < T ->
  let I f q := ex_RInt f 0 t /\ RInt f 0 t <= Q2R q in let N u := norm2 n (input c X u) in
  let whole i := Rabs (input c X t i) + added c S t i in match e with PathLength q _ => I (fun u => sqrt (N u)) q
  | EnergyBy q _ | Energy q _ _ _ _ _ => I N q | Peak qs q _ _ => sqrt (norm2 n whole) <= Q2R q /\
    forall i, (i < n)%nat -> whole i <= Q2R (nth i qs 0%Q) end.
Proof.
  intros H Ht. cbv zeta. unfold check_moving in H. rewrite Hkind in H. cbv beta zeta in H. apply andb_prop in H as [_ H].
  fold push in H. assert (W : forall z0 (way : nat * Q) (test : known -> bool),
    match nth_error (if Qeq_bool (snd way) z0 then known_at c d push z0 else known_at c d push (snd way)) (fst way)
      with Some (Some kn) => test kn | _ => false end = true ->
    exists z kn, nth_error (known_at c d push z) (fst way) = Some (Some kn) /\ test kn = true).
  { clear H. intros z0 way test H. destruct (Qeq_bool (snd way) z0); [exists z0|exists (snd way)];
      destruct (nth_error _ (fst way)) as [[kn|]|]; try discriminate; exists kn; auto. }
  destruct e as [q way|q way| |qs q ways way]; [| |discriminate|].
  - destruct (W _ _ (fun kn => length_moving q bound (norm_root kn) (in_pieces kn) (rate_of kn)) H) as [z [kn [HK HL]]].
    exact (length_spent z _ kn q t HK HL Ht).
  - destruct (W _ _ (fun kn => energy_moving c q bound (norm_root kn) (at_last kn) (in_pieces kn) (rate_of kn)) H) as [z [kn [HK HL]]].
    exact (energy_spent z _ kn q t HK HL Ht).
  - apply andb_prop in H as [H HN]. apply andb_prop in H as [H1 HA]. apply Qle_ok in H1. rewrite Q2R_1, Q2R_mult in H1.
    set (own := own_part c T_r mu1 mu2 mu3). assert (O : forall i, (i < n)%nat -> 0 <= added c S t i <= Q2R (own (nth i (sliding c) 0%Q))).
    { intros i Hi. split.
      - unfold added. rewrite Hkind. destruct (parts c T_r T_s mu1 mu2 mu3 delta Hprot Hkind) as [_ [A _]].
        pose proof (delta_pos c T_r T_s mu1 mu2 mu3 delta Hprot Hkind).
        pose proof (pull_pos c T_r T_s mu1 mu2 mu3 delta Hprot Hkind t). pose proof (Rabs_pos (S t i)).
        apply Rplus_le_le_0_compat; [lra|apply Rmult_le_pos; lra].
      - apply (added_below c T_r T_s mu1 mu2 mu3 delta Hprot Hkind X S i HM Hi t); [left; exact H1|exact Ht|apply S0; exact Hi]. }
    split.
    + destruct (W _ _ (fun kn => peak_moving c (q - root (fold_right (fun i a => own (nth i (sliding c) 0%Q) * own (nth i (sliding c) 0%Q) + a) 0
        (seq 0 n)))%Q bound (norm_root kn) (at_last kn) (in_pieces kn) (rate_of kn)) HN) as [z [kn [HK HL]]].
      pose proof (peak_norm z _ kn _ t HK HL Ht) as B. rewrite Q2R_minus in B.
      pose proof (norm_root_ok n (fun i => own (nth i (sliding c) 0%Q))) as R0. cbv beta in R0.
      set (b := Q2R (root _)) in *. eapply Rle_trans; [apply (norm_below n _ (fun i => Rabs (input c X t i) + Q2R (own (nth i (sliding c) 0%Q))))|].
      * intros i Hi. specialize (O i Hi). pose proof (Rabs_pos (input c X t i)). rewrite Rabs_right by lra. lra.
      * eapply Rle_trans; [apply norm_sum|]. rewrite norm_sizes. lra.
    + intros i Hi. rewrite forallb_forall in HA. specialize (HA i ltac:(apply in_seq; unfold n in Hi; lia)).
      destruct (W _ _ (fun kn => peak_moving c (nth i qs 0%Q - own (nth i (sliding c) 0%Q))%Q (nth i bounds 0%Q) (nth i (each_root kn) 0%Q) (at_last kn)
        (in_pieces kn) (rate_of kn)) HA) as [z [kn [HK HL]]].
      pose proof (peak_each z _ kn _ i t HK Hi HL Ht) as B. rewrite Q2R_minus in B. specialize (O i Hi). lra.
Qed.
End Efforts.
