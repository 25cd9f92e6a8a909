(** Functions of rows: the largest [|xi_k| / d_k] falls where every row draws its agent, at the worst weights. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Slide Rest FamilyCertificate FamilyFlow FamilyChecker FamilySound
  FamilyMotion.
Open Scope R_scope.

Lemma size_between n e w : check_tie n e = true -> Q2R (bottom e) <= w <= Q2R (top e) -> between e (Rabs w).
Proof.
  intros H Hw. unfold check_tie in H. apply andb_prop in H as [H _]. apply andb_prop in H as [_ H]. apply Qle_R in H. rewrite Q2R_0 in H.
  unfold between, lo, hi in *. destruct (positive e).
  - rewrite Rabs_right by lra. exact Hw.
  - rewrite !Q2R_opp in *. rewrite Rabs_left1 by lra. lra.
Qed.
Lemma Qred_R q : Q2R (Qred q) = Q2R q.
Proof. apply Qeq_eqR. apply Qred_correct. Qed.
(** members are linear *)
Lemma member_plus l : forall w x y i, member l w (fun j => x j + y j) i = member l w x i + member l w y i.
Proof.
  induction l as [|e l IH]; intros; simpl; [ring|]. rewrite IH. unfold pulls, heard.
  destruct (head e =? i)%nat, (mutual e), (tail e =? i)%nat; ring.
Qed.
Lemma member_scal l : forall w a x i, member l w (fun j => a * x j) i = a * member l w x i.
Proof.
  induction l as [|e l IH]; intros; simpl; [ring|]. rewrite IH. unfold pulls, heard.
  destruct (head e =? i)%nat, (mutual e), (tail e =? i)%nat; ring.
Qed.
Lemma member_same l : forall w x y i, (forall j, x j = y j) -> member l w x i = member l w y i.
Proof.
  induction l as [|e l IH]; intros w x y i H; simpl; [reflexivity|]. rewrite (IH _ x y i H). unfold pulls, heard. rewrite !H. reflexivity.
Qed.
Lemma member_xi l w P i : (forall v, In v (still P) -> member l w (fun j => Q2R (nth j (snd v) 0%Q)) i = 0) -> forall x,
  member l w x i = member l w (xi P x) i.
Proof.
  intros H x.
  rewrite (member_same l w x (fun j => xi P x j + fold_right (fun v a => Q2R (nth j (snd v) 0%Q) * x (fst v) + a) 0 (still P))) by (intros; unfold xi; ring).
  rewrite member_plus. enough (E : member l w (fun j => fold_right (fun v a => Q2R (nth j (snd v) 0%Q) * x (fst v) + a) 0 (still P)) i = 0) by (rewrite E; ring).
  induction (still P) as [|v s IH].
  - simpl. rewrite (member_same l w (fun _ => 0) (fun j => 0 * 0)) by (intros; ring). rewrite (member_scal l w 0 (fun _ => 0)). ring.
  - simpl. rewrite (member_plus l w (fun j => Q2R (nth j (snd v) 0%Q) * x (fst v))).
    rewrite IH by (intros; apply H; right; assumption).
    rewrite (member_same l w (fun j => Q2R (nth j (snd v) 0%Q) * x (fst v)) (fun j => x (fst v) * Q2R (nth j (snd v) 0%Q))) by (intros; ring).
    rewrite (member_scal l w (x (fst v))), H by (left; reflexivity). ring.
Qed.

(** * What the rows say *)
Section Rows.
Variables (n : nat) (d : list Q) (A : list nat) (z : nat -> R) (W : R).
Hypothesis HW : 0 <= W.
Hypothesis Hz : forall i, In i A -> Rabs (z i) <= W * Q2R (entry d i).
Lemma worst_ok e a q : between e a -> Q2R (worst e q) <= a * Q2R q.
Proof.
  intros B. unfold between in B. unfold worst. rewrite Q2R_mult. destruct (Qle_bool 0 q) eqn:E.
  - apply Qle_R in E. rewrite Q2R_0 in E. nra.
  - assert (Q2R q < 0).
    { apply Rnot_le_lt. intros N. rewrite <- Q2R_0 in N. apply Rle_Qle in N. apply Qle_bool_iff in N. congruence. }
    nra.
Qed.
Lemma heard_draws e w t s0 i g : check_tie n e = true -> Q2R (bottom e) <= w <= Q2R (top e) -> (g = 1 \/ g = -1) ->
  (t = i -> In s0 A) -> g * z i = W * Q2R (entry d i) ->
  W * (if (t =? i)%nat then Q2R (drawn d e t s0) else 0) <= g * heard t s0 w z i.
Proof.
  intros HT Hw Hg Hs Hi. pose proof (size_between n e w HT Hw) as B. unfold heard. destruct (Nat.eqb_spec t i) as [->|]; [|lra].
  specialize (Hz s0 (Hs eq_refl)). unfold drawn. pose proof (worst_ok e (Rabs w) (entry d i - entry d s0)%Q B) as K. rewrite Q2R_minus in K.
  apply (Rmult_le_compat_l W) in K; [|exact HW]. eapply Rle_trans; [exact K|].
  assert (S : g * (w * z s0) <= Rabs w * (W * Q2R (entry d s0))).
  { eapply Rle_trans; [apply Rle_abs|]. rewrite !Rabs_mult. assert (Rabs g = 1) by (destruct Hg as [-> | ->]; [apply Rabs_R1|rewrite Rabs_left by lra; lra]).
    rewrite H, Rmult_1_l. apply Rmult_le_compat_l; [apply Rabs_pos|exact Hz]. }
  replace (g * (Rabs w * z i - w * z s0)) with (Rabs w * (g * z i) - g * (w * z s0)) by ring. rewrite Hi. lra.
Qed.
Lemma heard_moves e w t s0 i : check_tie n e = true -> Q2R (bottom e) <= w <= Q2R (top e) -> (t = i -> In s0 A) -> In i A ->
  (forall j, In j A -> 0 <= Q2R (entry d j)) ->
  Rabs (heard t s0 w z i) <= W * (if (t =? i)%nat then Q2R (row_moved d e t s0) else 0).
Proof.
  intros HT Hw Hs Hi Hd. pose proof (size_between n e w HT Hw) as B. unfold between in B. unfold heard. destruct (Nat.eqb_spec t i) as [->|]; [|rewrite Rabs_R0; lra].
  pose proof (Hz s0 (Hs eq_refl)) as Z1. pose proof (Hz i Hi) as Z2. pose proof (Hd s0 (Hs eq_refl)) as D1. pose proof (Hd i Hi) as D2.
  unfold row_moved. rewrite Q2R_mult, Q2R_plus. pose proof (Rabs_pos w) as P.
  assert (E1 : Rabs (Rabs w * z i) <= Rabs w * (W * Q2R (entry d i))) by (rewrite Rabs_mult, Rabs_Rabsolu; apply Rmult_le_compat_l; assumption).
  assert (E2 : Rabs (w * z s0) <= Rabs w * (W * Q2R (entry d s0))) by (rewrite Rabs_mult; apply Rmult_le_compat_l; assumption).
  pose proof (Rabs_triang (Rabs w * z i) (- (w * z s0))) as T. rewrite Rabs_Ropp in T. unfold Rminus.
  assert (0 <= W * (Q2R (entry d i) + Q2R (entry d s0))) by (apply Rmult_le_pos; lra).
  assert (Rabs w * (W * (Q2R (entry d i) + Q2R (entry d s0))) <= Q2R (hi e) * (W * (Q2R (entry d i) + Q2R (entry d s0)))) by (apply Rmult_le_compat_r; lra).
  lra.
Qed.
Lemma row_sum_R l g i : Q2R (row_sum l g i) = fold_right (fun e a => (if (head e =? i)%nat then Q2R (g e (head e) (tail e)) else 0) +
  (if mutual e then if (tail e =? i)%nat then Q2R (g e (tail e) (head e)) else 0 else 0) + a) 0 l.
Proof.
  induction l as [|e l IH]; [apply Q2R_0|]. unfold row_sum. cbn [fold_right]. fold (row_sum l g i). rewrite Qred_R, !Q2R_plus, IH.
  destruct (head e =? i)%nat, (mutual e); simpl; destruct (tail e =? i)%nat; rewrite ?Q2R_0; ring.
Qed.
Lemma rows_draw l : forallb (check_tie n) l = true -> (forall e, In e l -> In (head e) A <-> In (tail e) A) -> forall w i g,
  admits l w -> In i A -> (g = 1 \/ g = -1) -> g * z i = W * Q2R (entry d i) -> W * Q2R (row_sum l (drawn d) i) <= g * member l w z i.
Proof.
  intros HT HC w i g Hw Hi Hg Ei. rewrite row_sum_R. revert w Hw. induction l as [|e l IH]; intros w Hw; simpl; [lra|].
  simpl in HT. apply andb_prop in HT as [HT1 HT2].
  specialize (IH HT2 (fun e0 H => HC e0 (or_intror H)) (shift w) (fun j e0 E => Hw (S j) e0 E)).
  pose proof (Hw 0%nat e eq_refl) as W0. destruct (HC e (or_introl eq_refl)) as [C1 C2].
  pose proof (heard_draws e (w 0%nat) (head e) (tail e) i g HT1 W0 Hg ltac:(intros E0; apply C1; rewrite E0; exact Hi) Ei) as K1.
  pose proof (heard_draws e (w 0%nat) (tail e) (head e) i g HT1 W0 Hg ltac:(intros E0; apply C2; rewrite E0; exact Hi) Ei) as K2.
  unfold pulls. destruct (mutual e); lra.
Qed.
Lemma rows_move l : forallb (check_tie n) l = true -> (forall e, In e l -> In (head e) A <-> In (tail e) A) ->
  (forall j, In j A -> 0 <= Q2R (entry d j)) -> forall w i, admits l w -> In i A -> Rabs (member l w z i) <= W * Q2R (row_sum l (row_moved d) i).
Proof.
  intros HT HC Hd w i Hw Hi. rewrite row_sum_R. revert w Hw. induction l as [|e l IH]; intros w Hw; simpl; [rewrite Rabs_R0; lra|].
  simpl in HT. apply andb_prop in HT as [HT1 HT2].
  specialize (IH HT2 (fun e0 H => HC e0 (or_intror H)) (shift w) (fun j e0 E => Hw (S j) e0 E)).
  pose proof (Hw 0%nat e eq_refl) as W0. destruct (HC e (or_introl eq_refl)) as [C1 C2].
  pose proof (heard_moves e (w 0%nat) (head e) (tail e) i HT1 W0 ltac:(intros E0; apply C1; rewrite E0; exact Hi) Hi Hd) as K1.
  pose proof (heard_moves e (w 0%nat) (tail e) (head e) i HT1 W0 ltac:(intros E0; apply C2; rewrite E0; exact Hi) Hi Hd) as K2.
  unfold pulls. eapply Rle_trans; [apply Rabs_triang|]. eapply Rle_trans; [apply Rplus_le_compat_r; apply Rabs_triang|].
  destruct (mutual e); [lra|]. rewrite Rabs_R0. lra.
Qed.
End Rows.

(** * Their decay *)
Section Decay.
Variable F : family.
Let c := frame F.
Let n := order c.
Let T := deadline c.
Let rho := Q2R (rho1 c).
Hypothesis Hframe : check_frame F = true.
Hypothesis Hmodes : forallb (check_mode F) (modes F) = true.
Variables (b : lyapunov) (d : list Q).
Let P := about b.
Hypothesis Hby : by_ b = Rows d.
Hypothesis Hagents : forall i, In i (its_agents P) -> (i < n)%nat.
Hypothesis Hpivots : forall v, In v (still P) -> In (fst v) (its_agents P).
Hypothesis H : check_rows_of F b d = true.

Lemma unmoved_ok i m w x : unmoved F i = true -> In m (modes F) -> member (ties m) w x i = 0.
Proof.
  intros Hu Hm. unfold unmoved in Hu. rewrite forallb_forall in Hu. specialize (Hu m Hm). revert w.
  induction (ties m) as [|e l IH]; intros w; [reflexivity|]. simpl in Hu. apply andb_prop in Hu as [H1 H2]. apply andb_prop in H1 as [A B].
  cbn [member]. rewrite (IH H2). unfold pulls, heard. apply negb_true_iff in A, B. rewrite A. destruct (mutual e); [simpl in B; rewrite B|]; ring.
Qed.
Lemma rows_means : means b = [].
Proof.
  unfold check_rows_of in H. cbv zeta in H. do 5 apply andb_prop in H as [H _]. destruct (means b); [reflexivity|discriminate].
Qed.
Lemma rows_parts : (forall m, In m (modes F) -> (forall e, In e (ties m) -> In (head e) (its_agents P) <-> In (tail e) (its_agents P)) /\
    forall w i v, admits (ties m) w -> In v (still P) -> member (ties m) w (fun j => Q2R (nth j (snd v) 0%Q)) i = 0) /\
  (forall i, In i (its_agents P) -> (In i (map fst (still P)) /\ unmoved F i = true /\ (forall x, xi P x i = 0) /\ Q2R (entry d i) = 0) \/
    (~ In i (map fst (still P)) /\ 0 < Q2R (entry d i) /\ forall m, In m (modes F) -> Q2R (decay b) * Q2R (entry d i) <= 2 * Q2R (row_sum (ties m) (drawn d) i))) /\
  forall i, In i (its_agents P) -> Q2R (entry d i) * Q2R (entry d i) <= Q2R (nth i (offs b) 0%Q) /\
    forall m, In m (modes F) -> sq (Q2R (row_sum (ties m) (row_moved d) i)) <= Q2R (nth i (inputs b) 0%Q).
Proof.
  pose proof H as K. unfold check_rows_of in K. cbv zeta in K. fold P in K. apply andb_prop in K as [K K5]. apply andb_prop in K as [K K4].
  apply andb_prop in K as [K K3]. apply andb_prop in K as [K K2]. apply andb_prop in K as [_ K1]. apply Z.ltb_lt in K1. rewrite forallb_forall in K2, K3, K4, K5. split; [|split].
  - intros m Hm. specialize (K3 m Hm). apply andb_prop in K3 as [A B]. rewrite forallb_forall in A, B. split.
    + intros e He. specialize (A e He). apply eqb_prop in A. rewrite <- !mem_In, A. reflexivity.
    + intros w i v Hw Hv. apply (rest_ok F Hmodes (common_of (still P)) m (snd v) Hm (B v Hv) w i Hw).
  - intros i Hi. specialize (K4 i Hi). destruct (mem i (map fst (still P))) eqn:E.
    + left. apply mem_In in E. apply andb_prop in K4 as [K4 C]. apply andb_prop in K4 as [A B]. split; [exact E|]. split; [exact A|].
      apply Qeq_R in C. rewrite Q2R_0 in C. split; [|exact C]. intros x.
      pose proof (crow_ok (common_of (still P)) (still P) i x K1 K2 P eq_refl) as R. rewrite (zero_vec_ok _ B x) in R. apply IZR_lt in K1.
      symmetry in R. apply Rmult_integral in R as [R|R]; [lra|exact R].
    + right. split; [intros I; apply mem_In in I; congruence|]. apply andb_prop in K4 as [A B]. apply Qpos in A. split; [exact A|].
      intros m Hm. rewrite forallb_forall in B. specialize (B m Hm). apply Qle_R in B. rewrite !Q2R_mult in B. replace (Q2R 2) with 2 in B by (unfold Q2R; simpl; lra). exact B.
  - intros i Hi. specialize (K5 i Hi). apply andb_prop in K5 as [A B]. apply Qle_R in A. rewrite Q2R_mult in A. split; [exact A|].
    intros m Hm. rewrite forallb_forall in B. specialize (B m Hm). cbv zeta in B. apply Qle_R in B. rewrite Q2R_mult in B. exact B.
Qed.
Lemma d_pos i : In i (its_agents P) -> 0 <= Q2R (entry d i).
Proof. intros Hi. destruct rows_parts as [_ [R _]]. destruct (R i Hi) as [[_ [_ [_ E]]]|[_ [E _]]]; [rewrite E; apply Rle_refl|apply Rlt_le; exact E]. Qed.
Lemma below_rows a x : 0 <= a -> below b a x <-> forall i, In i (its_agents P) -> Rabs (xi P x i) <= sqrt a * Q2R (entry d i).
Proof.
  intros Ha. unfold below. rewrite Hby. fold P. pose proof (sqrt_pos a) as S0. pose proof (sqrt_sqrt a Ha) as S1.
  split; intros K i Hi; specialize (K i Hi); pose proof (d_pos i Hi) as D; fold (entry d i) in K |- *; set (q := Q2R (entry d i)) in *.
  - apply abs_sq; [apply Rmult_le_pos; assumption|]. eapply Rle_trans; [exact K|]. unfold sq. rewrite <- S1 at 1. apply Req_le. ring.
  - assert (K2 : sq (xi P x i) <= sq (sqrt a * q)).
    { unfold sq. rewrite <- (Rabs_right (sqrt a * q)) by (apply Rle_ge, Rmult_le_pos; assumption).
      apply Rabs_le_between in K. rewrite (Rabs_right (sqrt a * q)) by (apply Rle_ge, Rmult_le_pos; assumption).
      assert (0 <= sqrt a * q) by (apply Rmult_le_pos; assumption). nra. }
    eapply Rle_trans; [exact K2|]. unfold sq. rewrite <- S1 at 3. apply Req_le. ring.
Qed.
Theorem rows_size : sizes F b.
Proof.
  intros x a i Ha Hx Hi. fold P in Hi |- *. pose proof (proj1 (below_rows a x Ha) Hx) as K0. clear Hx. rename K0 into Hx. destruct rows_parts as [R1 [R2 R3]]. destruct (R3 i Hi) as [A B].
  pose proof (sqrt_pos a) as S0. pose proof (sqrt_sqrt a Ha) as S1. split.
  - pose proof (Hx i Hi) as K. pose proof (d_pos i Hi) as D. set (q := Q2R (entry d i)) in *.
    assert (0 <= sqrt a * q) by (apply Rmult_le_pos; assumption). apply Rabs_le_between in K.
    apply Rle_trans with (sq (sqrt a * q)); [unfold sq; nra|]. unfold sq.
    replace (sqrt a * q * (sqrt a * q)) with (q * q * (sqrt a * sqrt a)) by ring. rewrite S1. apply Rmult_le_compat_r; assumption.
  - intros m w Hm Hw. destruct (R1 m Hm) as [C Z]. rewrite (member_xi (ties m) w P i (fun v Hv => Z w i v Hw Hv) x).
    pose proof (rows_move n d (its_agents P) (xi P x) (sqrt a) S0 Hx (ties m) (ties_ok F Hmodes m Hm) C d_pos w i Hw Hi) as K.
    specialize (B m Hm). set (u := Q2R (row_sum (ties m) (row_moved d) i)) in *. apply Rabs_le_between in K.
    apply Rle_trans with (sq (sqrt a * u)); [unfold sq; nra|]. unfold sq in *.
    replace (sqrt a * u * (sqrt a * u)) with (u * u * (sqrt a * sqrt a)) by ring. rewrite S1. apply Rmult_le_compat_r; assumption.
Qed.
Lemma xi_derive (Y : R -> nat -> R) (L : nat -> R) t i : (i < n)%nat -> (forall j, (j < n)%nat -> is_derive (fun u => Y u j) t (L j)) ->
  is_derive (fun u => xi P (Y u) i) t (xi P L i).
Proof.
  intros Hi HY. unfold xi. apply (is_derive_minus (fun u => Y u i)); [apply HY; exact Hi|].
  assert (Hp : forall v, In v (still P) -> (fst v < n)%nat) by (intros; apply Hagents, Hpivots; assumption).
  clear H Hpivots. induction (still P) as [|v s IH]; simpl; [apply (is_derive_const 0)|].
  apply (is_derive_plus (fun u => Q2R (nth i (snd v) 0%Q) * Y u (fst v))).
  - apply (is_derive_scal (fun u => Y u (fst v)) t (Q2R (nth i (snd v) 0%Q))). apply HY. apply Hp. left. reflexivity.
  - apply IH. intros; apply Hp; right; assumption.
Qed.
Lemma xi_cont (Y : R -> nat -> R) t i : (i < n)%nat -> (forall j, (j < n)%nat -> continuous (fun u => Y u j) t) ->
  continuous (fun u => xi P (Y u) i) t.
Proof.
  intros Hi HY. unfold xi. apply (continuous_minus (fun u => Y u i)); [apply HY; exact Hi|].
  assert (Hp : forall v, In v (still P) -> (fst v < n)%nat) by (intros; apply Hagents, Hpivots; assumption).
  clear H Hpivots. induction (still P) as [|v s IH]; simpl; [apply continuous_const|].
  apply (continuous_plus (fun u => Q2R (nth i (snd v) 0%Q) * Y u (fst v))).
  - apply (continuous_mult (fun _ => Q2R (nth i (snd v) 0%Q))); [apply continuous_const|]. apply HY. apply Hp. left. reflexivity.
  - apply IH. intros; apply Hp; right; assumption.
Qed.
Lemma follower_dec i : {In i (its_agents P) /\ ~ In i (map fst (still P))} + {~ (In i (its_agents P) /\ ~ In i (map fst (still P)))}.
Proof.
  destruct (in_dec Nat.eq_dec i (its_agents P)) as [A|A]; [|right; intros [B _]; exact (A B)].
  destruct (in_dec Nat.eq_dec i (map fst (still P))) as [B|B]; [right; intros [_ C]; exact (C B)|left; split; assumption].
Qed.
Theorem rows_decay : decays F b.
Proof.
  intros X Sl t0 t1 a HM Ht1 Ha H0. destruct rows_parts as [R1 [R2 _]]. pose proof (proj1 (below_rows a (X t0) Ha) H0) as K0. clear H0. rename K0 into H0.
  set (r := Q2R (decay b)) in *. destruct (positive_ F Hframe) as [P1 [P2 P3]]. pose proof HM as [_ [Ht0 _]]. fold c in P1, P2, P3, Ht0, Ht1. fold T rho in P1, P2, Ht0, Ht1.
  set (Y := fun u => X (Rmax t0 u)). set (e := fun u => exp (r / 2 * s c u)).
  set (q := fun i => if follower_dec i then / Q2R (entry d i) else 0).
  set (sg := fun j : nat => if (j <? n)%nat then 1 else -1). set (ix := fun j => if (j <? n)%nat then j else (j - n)%nat).
  set (f := fun j u => sg j * (q (ix j) * (e u * xi P (Y u) (ix j)))).
  assert (Hix : forall j, (j < n + n)%nat -> (ix j < n)%nat) by (intros j Hj; unfold ix; destruct (Nat.ltb_spec j n); lia).
  assert (Hsg : forall j, sg j = 1 \/ sg j = -1) by (intros j; unfold sg; destruct (j <? n)%nat; auto).
  assert (Hq : forall i, 0 <= q i).
  { intros i. unfold q. destruct (follower_dec i) as [[A B]|_]; [|lra]. destruct (R2 i A) as [[C _]|[_ [C _]]]; [contradiction|].
    left. apply Rinv_0_lt_compat. exact C. }
  assert (Ee : forall u, u < T -> is_derive e u (r / 2 * gain T rho (k c) u * e u)).
  { intros u Hu. unfold e. evar_last. { apply is_derive_comp; [apply is_derive_exp|]. apply is_derive_scal. apply (clock_derive T rho (k c) P1 u Hu). }
    unfold scal; simpl; unfold mult; simpl. change (clock T rho (k c) u) with (s c u). ring. }
  assert (Pe : forall u, 0 < e u) by (intros; apply exp_pos).
  assert (YC : forall u i, t0 <= u < T -> (i < n)%nat -> continuous (fun u => xi P (Y u) i) u).
  { intros u i Hu Hi. apply xi_cont; [exact Hi|]. intros j Hj. apply (Y_cont F X Sl t0 HM u j Hu Hj). }
  destruct (Y_moves F X Sl t0 HM) as [D HD]. fold c in HD. fold T rho n in HD.
  assert (G : forall j u, t0 <= u < T -> (j < n + n)%nat -> f j u <= e t0 * sqrt a).
  { intros j u Hu Hj. apply (never_grows (n + n) f t0 T D); [| | |exact Hu|exact Hj]; clear j u Hu Hj.
    - intros j u Hj Hu. unfold f. apply (continuous_mult (fun _ => sg j)); [apply continuous_const|].
      apply (continuous_mult (fun _ => q (ix j))); [apply continuous_const|].
      apply (continuous_mult e (fun u => xi P (Y u) (ix j))); [apply @ex_derive_continuous; eexists; apply Ee; lra|apply YC; auto].
    - intros u Hu Hj j Hjn. destruct (HD u Hu Hj) as [m [w [Hm [Hw E]]]]. set (L := member (ties m) w (Y u)) in *. set (g := gain T rho (k c) u) in *.
      set (i := ix j). assert (Hi : (i < n)%nat) by (apply Hix; exact Hjn).
      exists (sg j * (q i * (r / 2 * g * e u * xi P (Y u) i + e u * xi P (fun v => - (g * L v)) i))). split.
      + unfold f. fold i. apply is_derive_scal. apply is_derive_scal.
        apply (is_derive_mult e (fun u => xi P (Y u) i) u); [apply Ee; lra| |intros; apply Rmult_comm].
        apply xi_derive; [exact Hi|]. intros v Hv. apply E. exact Hv.
      + intros Mx. destruct (follower_dec i) as [[A B]|N].
        2:{ assert (Z : q i = 0) by (unfold q; destruct (follower_dec i); [contradiction|reflexivity]). rewrite Z, Rmult_0_l, Rmult_0_r. lra. }
        destruct (R2 i A) as [[C _]|[_ [Dp Dr]]]; [contradiction|]. specialize (Dr m Hm).
        assert (Eq : q i = / Q2R (entry d i)) by (unfold q; destruct (follower_dec i) as [_|Nf]; [reflexivity|exfalso; apply Nf; split; assumption]).
        set (di := Q2R (entry d i)) in *. set (W := sg j * xi P (Y u) i / di).
        assert (Fj : f j u = e u * W) by (unfold f, W; fold i; rewrite Eq; field; lra).
        assert (All : forall v, In v (its_agents P) -> Rabs (xi P (Y u) v) <= W * Q2R (entry d v)).
        { intros v Hv. destruct (R2 v Hv) as [[_ [_ [Z0 Z1]]]|[Nv [Dv _]]]; [rewrite Z0, Z1, Rabs_R0; lra|].
          assert (Ev : q v = / Q2R (entry d v)) by (unfold q; destruct (follower_dec v) as [_|Nf]; [reflexivity|exfalso; apply Nf; split; assumption]).
          pose proof (Hagents v Hv) as Hvn. set (dv := Q2R (entry d v)) in *.
          pose proof (Mx v ltac:(lia)) as M1. pose proof (Mx (v + n)%nat ltac:(lia)) as M2. rewrite Fj in M1, M2. unfold f, sg, ix in M1, M2.
          destruct (Nat.ltb_spec v n); [|lia]. destruct (Nat.ltb_spec (v + n) n); [lia|]. replace (v + n - n)%nat with v in M2 by lia. rewrite Ev in M1, M2.
          pose proof (Pe u) as Pu. set (y := xi P (Y u) v) in *.
          assert (N1 : y / dv <= W) by (apply (Rmult_le_reg_l (e u)); [exact Pu|]; unfold Rdiv; lra).
          assert (N2 : - (y / dv) <= W) by (apply (Rmult_le_reg_l (e u)); [exact Pu|]; unfold Rdiv; lra).
          assert (Ey : y = y / dv * dv) by (field; lra). apply Rabs_le. rewrite Ey. split; nra. }
        assert (W0 : 0 <= W). { pose proof (All i A) as K. pose proof (Rabs_pos (xi P (Y u) i)). fold di in K. nra. }
        destruct (R1 m Hm) as [C Z].
        assert (Ei : sg j * xi P (Y u) i = W * di) by (unfold W; field; lra).
        pose proof (rows_draw n d (its_agents P) (xi P (Y u)) W W0 All (ties m) (ties_ok F Hmodes m Hm) C w i (sg j) Hw A (Hsg j) Ei) as K.
        rewrite <- (member_xi (ties m) w P i (fun v Hv => Z w i v Hw Hv) (Y u)) in K. fold L in K.
        assert (EL : xi P (fun v => - (g * L v)) i = - (g * L i)).
        { unfold xi. assert (S0 : fold_right (fun v a0 => Q2R (nth i (snd v) 0%Q) * - (g * L (fst v)) + a0) 0 (still P) = 0); [|rewrite S0; ring].
          assert (Lp : forall v, In v (still P) -> L (fst v) = 0).
          { intros v Hv. destruct (R2 (fst v) (Hpivots v Hv)) as [[_ [U _]]|[Nv _]]; [apply (unmoved_ok (fst v) m w (Y u) U Hm)|].
            exfalso. apply Nv. apply in_map. exact Hv. }
          clear - Lp. induction (still P) as [|v l IH]; simpl; [reflexivity|]. rewrite Lp by (left; reflexivity).
          rewrite IH by (intros; apply Lp; right; assumption). ring. }
        rewrite EL. pose proof (gain_pos T rho (k c) P2 P3 u ltac:(lra)) as Gp. fold g in Gp. pose proof (Pe u) as Pu.
        replace (sg j * (q i * (r / 2 * g * e u * xi P (Y u) i + e u * - (g * L i))))
          with (q i * (g * e u) * (r / 2 * (sg j * xi P (Y u) i) - sg j * L i)) by ring.
        rewrite Ei. assert (0 <= q i * (g * e u)) by (apply Rmult_le_pos; [apply Hq|apply Rmult_le_pos; lra]).
        assert (r / 2 * (W * di) <= sg j * L i); [|nra]. eapply Rle_trans; [|exact K].
        apply (Rmult_le_compat_l W) in Dr; [|exact W0]. lra.
    - intros j Hj. unfold f. set (i := ix j). pose proof (sqrt_pos a) as S0. pose proof (Pe t0) as Pu. unfold q. destruct (follower_dec i) as [[A B]|_].
      2:{ rewrite Rmult_0_l, Rmult_0_r. apply Rmult_le_pos; lra. }
      destruct (R2 i A) as [[C _]|[_ [Dp _]]]; [contradiction|]. specialize (H0 i A). unfold Y. rewrite Rmax_left by lra.
      set (di := Q2R (entry d i)) in *. set (y := xi P (X t0) i) in *. apply Rabs_le_between in H0.
      assert (Ey : y = y / di * di) by (field; lra). assert (B1 : - sqrt a <= y / di <= sqrt a) by (split; apply (Rmult_le_reg_r di); lra).
      replace (sg j * (/ di * (e t0 * y))) with (e t0 * (sg j * (y / di))) by (unfold Rdiv; ring).
      apply Rmult_le_compat_l; [lra|]. destruct (Hsg j) as [-> | ->]; lra. }
  assert (E0 : exp (- (r * (s c t1 - s c t0))) = (e t0 / e t1) * (e t0 / e t1)).
  { unfold e, Rdiv. rewrite <- exp_Ropp, <- !exp_plus. f_equal. field. }
  pose proof (Pe t0) as Pa. pose proof (Pe t1) as Pb. assert (Q0 : 0 <= e t0 / e t1) by (apply Rmult_le_pos; [lra|left; apply Rinv_0_lt_compat; exact Pb]).
  enough (Fin : below b (e t0 / e t1 * (e t0 / e t1) * a) (X t1)) by (rewrite <- E0 in Fin; exact Fin).
  apply (below_rows _ (X t1)); [apply Rmult_le_pos; [apply Rmult_le_pos; exact Q0|exact Ha]|]. intros i Hi.
  rewrite sqrt_mult_alt by (apply Rmult_le_pos; exact Q0). rewrite sqrt_square by exact Q0.
  destruct (R2 i Hi) as [[_ [_ [Z0 Z1]]]|[Nv [Dv _]]]; [rewrite Z0, Z1, Rabs_R0; lra|].
  assert (Ev : q i = / Q2R (entry d i)) by (unfold q; destruct (follower_dec i) as [_|Nf]; [reflexivity|exfalso; apply Nf; split; assumption]).
  pose proof (Hagents i Hi) as Hin. pose proof (G i t1 Ht1 ltac:(lia)) as G1. pose proof (G (i + n)%nat t1 Ht1 ltac:(lia)) as G2. unfold f, sg, ix in G1, G2.
  destruct (Nat.ltb_spec i n); [|lia]. destruct (Nat.ltb_spec (i + n) n); [lia|]. replace (i + n - n)%nat with i in G2 by lia. rewrite Ev in G1, G2.
  unfold Y in G1, G2. rewrite Rmax_right in G1, G2 by lra. set (di := Q2R (entry d i)) in *. set (y := xi P (X t1) i) in *.
  assert (Ey : e t1 * y = / di * (e t1 * y) * di) by (field; lra).
  assert (B1 : e t1 * y <= e t0 * sqrt a * di) by (rewrite Ey; apply Rmult_le_compat_r; lra).
  assert (B2 : - (e t1 * y) <= e t0 * sqrt a * di) by (rewrite Ey; rewrite <- Ropp_mult_distr_l_reverse; apply Rmult_le_compat_r; lra).
  apply Rabs_le. split; apply (Rmult_le_reg_l (e t1)); try exact Pb; unfold Rdiv.
  - replace (e t1 * - (e t0 * / e t1 * sqrt a * di)) with (- (e t0 * sqrt a * di)) by (field; lra). lra.
  - replace (e t1 * (e t0 * / e t1 * sqrt a * di)) with (e t0 * sqrt a * di) by (field; lra). exact B1.
Qed.
Lemma rows_value x : exists a, 0 <= a /\ below b a x.
Proof.
  set (g := fun i => sq (xi P x i / Q2R (entry d i))). assert (G0 : forall i, 0 <= g i) by (intros; apply sq_pos).
  set (a := fold_right (fun i a => g i + a) 0 (its_agents P)).
  assert (S : 0 <= a /\ forall i, In i (its_agents P) -> g i <= a).
  { unfold a. generalize (its_agents P). clear a. induction l as [|j l [I1 I2]]; simpl; [split; [lra|intros i []]|]. pose proof (G0 j). split; [lra|].
    intros i [->|Hi]; [lra|]. specialize (I2 i Hi). lra. }
  destruct S as [S0 S1]. exists a. split; [exact S0|]. unfold below. rewrite Hby. fold P. intros i Hi. fold (entry d i).
  destruct rows_parts as [_ [R2 _]]. destruct (R2 i Hi) as [[_ [_ [Z0 Z1]]]|[_ [Dp _]]].
  - rewrite Z0, Z1. unfold sq. lra.
  - specialize (S1 i Hi). unfold g in S1. set (di := Q2R (entry d i)) in *. replace (xi P x i) with (xi P x i / di * di) by (field; lra).
    unfold sq in *. set (y := xi P x i / di) in *. assert (0 <= di * di) by nra. nra.
Qed.
End Decay.
