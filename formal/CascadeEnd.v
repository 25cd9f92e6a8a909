(** The cascade on its way and at the deadline: by a Lyapunov function positions agree, velocities vanish where the gain
    does not outgrow it, and the common position is known. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia Psatz FunctionalExtensionality.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Slide Solution Main Weighted AgentCertificate AgentForms
  AgentMotion AgentEnd AgentRest CascadeCertificate CascadeMotion.
Open Scope R_scope.

Section Course.
Variables (c : cascade) (f : func) (F : mat) (mm : Z).
Let a := team c.
Let G := graph a.
Let N := order G.
Let T := deadline G.
Let d := prepare G.
Hypothesis Hprot : check_protocol G = true.
Hypothesis Hgain : positive_gain a.
Hypothesis Hcap : cap a = None.
Hypothesis Hin : forall e, In e (edges G) -> (tgt e < N)%nat /\ (src e < N)%nat.
Hypothesis Hls : good (dls d) (map wt (edges G)) = true.
Hypothesis EF : Checker.form N (dls d) (dL d) (ly f) = Some (F, mm).
Hypothesis Hends : check_ends G d f = true.
Hypothesis Hrate : nonneg N (dsw d) (dfw d) (rate_form (dls d) (dL d) F (rate f)) = true.
Let S := pair (edges G) (ly f).
Let b := Q2R (rate f) / 2.
Let PS : positive S := pair_positive G f Hls F mm EF Hends.
Lemma V_ext x z : (forall j, (j < N)%nat -> x j = z j) -> V (edges G) (ly f) x = V (edges G) (ly f) z.
Proof.
  intros H. rewrite !(V_bil G f Hls F mm EF). destruct (form_ok _ _ _ _ _ _ _ Hls eq_refl EF) as [_ [Hfit _]]. destruct (fits_ok _ _ Hfit) as [F1 F2].
  rewrite (bil_ext_l F x z) by (intros; apply H; unfold N; lia). rewrite (bil_ext_r F N z x z F2 H). reflexivity.
Qed.
Lemma V_pos x : 0 <= V (edges G) (ly f) x.
Proof. rewrite <- (pair_self G f Hls F mm EF). apply (above0 S PS). Qed.
Lemma V_scal q x : V (edges G) (ly f) (fun j => q * x j) = q * q * V (edges G) (ly f) x.
Proof. rewrite <- !(pair_self G f Hls F mm EF). fold G S. rewrite (scales S PS), (swaps S PS), (scales S PS). ring. Qed.
Theorem course m h X Sl t : (forall i, (i < m)%nat -> tracks c (h i) (X i) (Sl i)) -> 0 <= t < T ->
  root c f m (fun i => placed (h i) (X i t) 0) <= exp (- (b * turns a t)) * root c f m (fun i => placed (h i) (X i 0) 0) +
    root c f m (fun i => lag c (h i) (X i 0) 0) * carried c b t.
Proof.
  intros HX Ht. set (x := fun i u => place (h i) (X i) u). set (v := fun i u => speed (X i) u). set (l := fun i u => lags c (h i) (X i) u).
  set (W := fun u => sum m (fun i => S (x i u) (x i u))). set (D := root c f m (fun i => lag c (h i) (X i 0) 0)).
  assert (T0 : 0 < T) by apply (T_k a Hprot).
  assert (ER : forall u, 0 <= u -> root c f m (fun i => placed (h i) (X i u) 0) = sqrt (W u)).
  { intros u Hu. unfold root, W. f_equal. apply sum_ext. intros i Hi. unfold S, x. rewrite (pair_self G f Hls F mm EF), place_at by exact Hu. reflexivity. }
  rewrite !ER by lra.
  assert (P : forall u, 0 <= W u).
  { intros u. unfold W. rewrite <- (sum_zero m (fun _ => 0)) by reflexivity. apply sum_le. intros. apply (above0 S PS). }
  assert (D0 : 0 <= D) by apply sqrt_pos.
  apply (driven_root c Hprot b D W (fun u => sum m (fun i => S (v i u) (x i u) + S (x i u) (v i u)))); [exact D0| | |exact P| |exact Ht]; intros u Hu.
  - apply (is_derive_sum m (fun u i => S (x i u) (x i u)) (fun i => S (v i u) (x i u) + S (x i u) (v i u))). intros i Hi.
    apply (pair_derive G f Hls F mm EF (fun u => x i u) (fun u => x i u)); intros j Hj;
      apply (place_derive c (h i) (X i) (Sl i) (HX i Hi) u j Hu Hj).
  - apply (continuous_sum m (fun u i => S (x i u) (x i u))). intros i Hi.
    apply (pair_continuous G f Hls F mm EF (fun u => x i u) (fun u => x i u)); intros j Hj;
      apply (place_continuous c (h i) (X i) (Sl i) (HX i Hi) u j Hu Hj).
  - pose proof (eta_pos a Hprot Hgain u (proj2 Hu)) as E0. set (E := exp (- (alpha c * turns a u))).
    assert (Vl : forall i, (i < m)%nat -> sqrt (S (l i u) (l i u)) = E * sqrt (V (edges G) (ly f) (lag c (h i) (X i 0) 0))).
    { intros i Hi. unfold S. rewrite (pair_self G f Hls F mm EF).
      rewrite (V_ext (l i u) (fun j => E * l i 0 j)) by (intros j Hj; apply (lags_die c (h i) (X i) (Sl i) Hprot Hgain Hcap Hin (HX i Hi) u j Hu Hj)).
      rewrite V_scal, sqrt_mult by (apply V_pos || apply Rle_0_sqr). rewrite sqrt_square by (left; apply exp_pos). unfold l. rewrite lags_at by lra. reflexivity. }
    assert (One : forall i, (i < m)%nat -> S (v i u) (x i u) + S (x i u) (v i u) <=
      2 * (E * (sqrt (V (edges G) (ly f) (lag c (h i) (X i 0) 0)) * sqrt (S (x i u) (x i u)))) + - (2 * (b * eta a u)) * S (x i u) (x i u)).
    { intros i Hi. rewrite (swaps S PS (x i u) (v i u)).
      assert (Ev : v i u = fun j => l i u j + - eta a u * lap (edges G) (x i u) j).
      { apply functional_extensionality. intros j. unfold v, l, lags, x, lp. fold a G. ring. }
      rewrite Ev, (adds S PS), (scales S PS). pose proof (cross S PS (l i u) (x i u)) as C1. rewrite (Vl i Hi) in C1.
      pose proof (pair_rate G f Hls F mm EF Hrate (x i u)) as C2. fold G S in C2.
      apply (Rmult_le_compat_l (eta a u)) in C2; [|lra]. unfold b. lra. }
    eapply Rle_trans; [apply sum_le; exact One|]. rewrite sum_plus, !sum_scal. fold (W u).
    pose proof (cross _ (dot_positive m) (fun i => sqrt (V (edges G) (ly f) (lag c (h i) (X i 0) 0))) (fun i => sqrt (S (x i u) (x i u)))) as C.
    cbv beta in C. rewrite (sum_ext m (fun i => sqrt (V _ _ _) * sqrt (V _ _ _)) (fun i => V (edges G) (ly f) (lag c (h i) (X i 0) 0))) in C by (intros; apply sqrt_sqrt, V_pos).
    rewrite (sum_ext m (fun i => sqrt (S _ _) * sqrt (S _ _)) (fun i => S (x i u) (x i u))) in C by (intros; apply sqrt_sqrt, (above0 S PS)).
    fold (W u) in C. change (sqrt (sum m (fun i => V (edges G) (ly f) (lag c (h i) (X i 0) 0)))) with D in C.
    assert (E1 : 0 < E) by apply exp_pos. apply (Rmult_le_compat_l E) in C; [|lra]. change (team c) with a. fold E. clear - C. nra.
Qed.
Lemma one_root x : root c f 1 (fun _ => x) = sqrt (V (edges G) (ly f) x).
Proof. unfold root, sum. simpl. rewrite Rplus_0_r. reflexivity. Qed.
Corollary course_one h X Sl t : tracks c h X Sl -> 0 <= t < T -> sqrt (V (edges G) (ly f) (place h X t)) <=
  exp (- (b * turns a t)) * sqrt (V (edges G) (ly f) (place h X 0)) + sqrt (V (edges G) (ly f) (lags c h X 0)) * carried c b t.
Proof.
  intros HX Ht. pose proof (course 1 (fun _ => h) (fun _ => X) (fun _ => Sl) t (fun _ _ => HX) Ht) as C. cbv beta in C. rewrite !one_root in C.
  rewrite (place_at h X t) by lra. rewrite (place_at h X 0) by lra. rewrite lags_at by lra. exact C.
Qed.

(** * How far the drive carries *)
Hypothesis Ha : 0 < alpha c.
Lemma carried_falls mu t : mu <= b -> mu <= alpha c -> 0 <= t < T -> carried c b t <= t * exp (- (mu * turns a t)).
Proof.
  intros H1 H2 Ht. rewrite (carried_ok c Hprot) by exact Ht. fold a.
  assert (I : pushed c (b - alpha c) t - t * exp ((b - mu) * turns a t) <= pushed c (b - alpha c) 0 - 0 * exp ((b - mu) * turns a 0)).
  { apply (decreasing T 0 (fun t => pushed c (b - alpha c) t - t * exp ((b - mu) * turns a t))
      (fun t => exp ((b - alpha c) * turns a t) - (1 * exp ((b - mu) * turns a t) + t * ((b - mu) * eta a t * exp ((b - mu) * turns a t))))); [| | |exact Ht]; intros u Hu.
    - apply (is_derive_minus (pushed c (b - alpha c)) (fun t => t * exp ((b - mu) * turns a t))); [apply (pushed_derive c Hprot); apply Hu|].
      apply (is_derive_times (fun t => t) (fun t => exp ((b - mu) * turns a t))); [apply @is_derive_id|apply (decays_derive c Hprot); apply Hu].
    - apply (continuous_minus (pushed c (b - alpha c)) (fun t => t * exp ((b - mu) * turns a t))).
      + apply @ex_derive_continuous. eexists. apply (pushed_derive c Hprot). apply Hu.
      + apply (continuous_mult (fun t => t) (fun t => exp ((b - mu) * turns a t))); [apply continuous_id|apply (decays_continuous c Hprot); apply Hu].
    - pose proof (turns_pos a Hprot Hgain u Hu) as S0. pose proof (eta_pos a Hprot Hgain u (proj2 Hu)) as E0.
      assert (exp ((b - alpha c) * turns a u) <= exp ((b - mu) * turns a u)) by (apply exp_le, Rmult_le_compat_r; lra).
      assert (0 <= u * ((b - mu) * eta a u * exp ((b - mu) * turns a u))).
      { repeat apply Rmult_le_pos; try lra. left. apply exp_pos. }
      lra. }
  rewrite pushed_0, Rmult_0_l in I. apply (Rmult_le_reg_l (exp (b * turns a t))); [apply exp_pos|].
  rewrite <- !Rmult_assoc, <- exp_plus. replace (b * turns a t + - (b * turns a t)) with 0 by ring. rewrite exp_0, Rmult_1_l.
  replace (exp (b * turns a t) * t * exp (- (mu * turns a t))) with (t * (exp (b * turns a t) * exp (- (mu * turns a t)))) by ring.
  rewrite <- exp_plus. replace (b * turns a t + - (mu * turns a t)) with ((b - mu) * turns a t) by ring. lra.
Qed.
(** and by how much the gain enlarges that *)
Lemma carried_fast mu t : 0 < mu -> 2 * mu <= b - / k G -> 2 * mu <= alpha c -> 0 <= t < T ->
  eta a t * carried c b t <= / mu * exp (- (mu * turns a t)).
Proof.
  intros H0 H1 H2 Ht. rewrite (carried_ok c Hprot) by exact Ht. fold a. set (p := 2 * mu - b). set (q := b - alpha c).
  set (w := fun t => eta a t * exp (p * turns a t) * pushed c q t - / mu * exp (mu * turns a t)).
  assert (I : w t <= w 0).
  { apply (decreasing T 0 w (fun t => (theta c t * sq (eta a t) * exp (p * turns a t) + eta a t * (p * eta a t * exp (p * turns a t))) * pushed c q t
      + eta a t * exp (p * turns a t) * exp (q * turns a t) - / mu * (mu * eta a t * exp (mu * turns a t)))); [| | |exact Ht]; intros u Hu.
    - apply (is_derive_minus (fun t => eta a t * exp (p * turns a t) * pushed c q t) (fun t => / mu * exp (mu * turns a t))).
      + apply (is_derive_times (fun t => eta a t * exp (p * turns a t)) (pushed c q)); [|apply (pushed_derive c Hprot); apply Hu].
        apply (is_derive_times (eta a) (fun t => exp (p * turns a t))); [apply (gain_derive c Hprot Hgain Hcap); apply Hu|apply (decays_derive c Hprot); apply Hu].
      + apply is_derive_scal. apply (decays_derive c Hprot). apply Hu.
    - apply (continuous_minus (fun t => eta a t * exp (p * turns a t) * pushed c q t) (fun t => / mu * exp (mu * turns a t))).
      + apply (continuous_mult (fun t => eta a t * exp (p * turns a t)) (pushed c q)).
        * apply (continuous_mult (eta a) (fun t => exp (p * turns a t))); [apply (eta_continuous a); apply Hu|apply (decays_continuous c Hprot); apply Hu].
        * apply @ex_derive_continuous. eexists. apply (pushed_derive c Hprot). apply Hu.
      + apply (continuous_mult (fun _ => / mu)); [apply continuous_const|apply (decays_continuous c Hprot); apply Hu].
    - pose proof (turns_pos a Hprot Hgain u Hu) as S0. pose proof (eta_pos a Hprot Hgain u (proj2 Hu)) as E0.
      destruct (theta_ok c Hprot Hgain Hcap u (proj2 Hu)) as [_ Th]. fold a G in Th.
      assert (P0 : 0 <= pushed c q u).
      { unfold pushed. apply RInt_ge_0; [apply Hu| |intros; left; apply exp_pos].
        apply (ex_RInt_continuous (fun r => exp (q * turns a r))). intros z [_ Hz]. apply (decays_continuous c Hprot).
        eapply Rle_lt_trans; [exact Hz|]. apply Rmax_lub_lt; [apply (T_k a Hprot)|apply Hu]. }
      set (e := eta a u) in *. set (x := exp (p * turns a u)). assert (X0 : 0 < x) by apply exp_pos.
      assert (A1 : (theta c u + p) * (e * e * x * pushed c q u) <= 0).
      { assert (0 <= e * e * x * pushed c q u) by (repeat apply Rmult_le_pos; lra). assert (theta c u + p <= 0) by (unfold p; lra). nra. }
      assert (A2 : x * exp (q * turns a u) <= exp (mu * turns a u)).
      { unfold x. rewrite <- exp_plus. apply exp_le. rewrite <- Rmult_plus_distr_r. apply Rmult_le_compat_r; unfold p, q; lra. }
      assert (A3 : / mu * (mu * e * exp (mu * turns a u)) = e * exp (mu * turns a u)) by (field; lra). rewrite A3.
      apply (Rmult_le_compat_l e) in A2; [|lra]. unfold sq. lra. }
  unfold w in I. rewrite pushed_0, (turns_0 a), !Rmult_0_r, exp_0 in I. assert (M : 0 < / mu) by (apply Rinv_0_lt_compat; exact H0).
  assert (J : eta a t * exp (p * turns a t) * pushed c q t <= / mu * exp (mu * turns a t)) by lra.
  apply (Rmult_le_reg_l (exp (2 * mu * turns a t))); [apply exp_pos|].
  replace (exp (2 * mu * turns a t) * (eta a t * (exp (- (b * turns a t)) * pushed c q t)))
    with (eta a t * (exp (2 * mu * turns a t) * exp (- (b * turns a t))) * pushed c q t) by ring. rewrite <- exp_plus.
  replace (exp (2 * mu * turns a t) * (/ mu * exp (- (mu * turns a t)))) with (/ mu * (exp (2 * mu * turns a t) * exp (- (mu * turns a t)))) by ring.
  rewrite <- exp_plus. replace (2 * mu * turns a t + - (b * turns a t)) with (p * turns a t) by (unfold p; ring).
  replace (2 * mu * turns a t + - (mu * turns a t)) with (mu * turns a t) by ring. exact J.
Qed.

(** * At the deadline *)
Variables (h : nat -> R) (X : R -> nat -> nat -> R) (Sl : R -> nat -> R).
Hypothesis HX : tracks c h X Sl.
Lemma dies_out (z : R -> R) K mu : 0 < mu -> 0 <= K -> (forall t, 0 <= t < T -> Rabs (z t) <= K * exp (- (mu * turns a t))) ->
  filterlim z (at_left T) (locally 0).
Proof.
  intros H0 HK H. apply (AgentEnd.vanishes a Hprot Hgain z 0 (2 * mu) (K * K) Hcap).
  - apply Rle_0_sqr.
  - simpl. rewrite Rmult_0_r. apply Rmult_lt_0_compat; [lra|apply (T_k a Hprot)].
  - intros t Ht. simpl pow. unfold sq. rewrite !Rmult_1_l. specialize (H t Ht).
    replace (2 * mu * turns a t) with (mu * turns a t + mu * turns a t) by ring. rewrite Ropp_plus_distr, exp_plus.
    set (e := exp _) in *. rewrite <- (Rabs_right (z t * z t)) by (apply Rle_ge, Rle_0_sqr). rewrite Rabs_mult.
    replace (K * K * (e * e)) with (K * e * (K * e)) by ring. apply Rmult_le_compat; try apply Rabs_pos; exact H.
Qed.
Let u0 := sqrt (V (edges G) (ly f) (place h X 0)).
Let d0 := sqrt (V (edges G) (ly f) (lags c h X 0)).
Let pos_u0 : 0 <= u0 := sqrt_pos _.
Let pos_d0 : 0 <= d0 := sqrt_pos _.
Lemma size_of y q x : 0 <= q -> sq y <= q * V (edges G) (ly f) x -> Rabs y <= sqrt q * sqrt (V (edges G) (ly f) x).
Proof.
  intros Hq H. rewrite <- sqrt_mult by (try exact Hq; apply V_pos). rewrite <- sqrt_Rsqr_abs. apply sqrt_le_1_alt. exact H.
Qed.
Lemma agrees q cs j : 0 < b -> 0 <= Q2R (nth j cs 0%Q) -> (forall x, sq (x j - end_state G x j) <= Q2R (nth j cs 0%Q) * V (edges G) (ly f) x) ->
  deviation f = Some (q, cs) -> filterlim (fun t => away a h (X t) 0 j) (at_left T) (locally 0).
Proof.
  intros Hb Hq H _. set (mu := Rmin b (alpha c)). assert (M0 : 0 < mu) by (apply Rmin_pos; assumption).
  pose proof (Rmin_l b (alpha c)) as M1. pose proof (Rmin_r b (alpha c)) as M2. fold mu in M1, M2.
  assert (T0 : 0 < T) by apply (T_k a Hprot). set (s := sqrt (Q2R (nth j cs 0%Q))). assert (S0 : 0 <= s) by apply sqrt_pos.
  assert (dT : 0 <= d0 * T) by (apply Rmult_le_pos; [exact pos_d0|lra]).
  apply (dies_out _ (s * (u0 + d0 * T)) mu M0); [apply Rmult_le_pos; [exact S0|]; pose proof pos_u0; lra|].
  intros t Ht. unfold away. rewrite <- place_at by lra. fold G. eapply Rle_trans; [apply size_of; [exact Hq|apply (H (place h X t))]|]. fold s.
  rewrite Rmult_assoc. apply Rmult_le_compat_l; [exact S0|]. eapply Rle_trans; [apply (course_one h X Sl t HX Ht)|]. fold u0 d0.
  pose proof (carried_falls mu t M1 M2 Ht) as C. set (e := exp (- (mu * turns a t))) in *. assert (E0 : 0 < e) by apply exp_pos.
  pose proof (turns_pos a Hprot Hgain t Ht) as S1.
  assert (E1 : exp (- (b * turns a t)) <= e) by (apply exp_le, Ropp_le_contravar, Rmult_le_compat_r; lra).
  apply (Rmult_le_compat_r u0) in E1; [|exact pos_u0]. apply (Rmult_le_compat_l d0) in C; [|exact pos_d0].
  assert (d0 * (t * e) <= d0 * (T * e)) by (apply Rmult_le_compat_l; [exact pos_d0|]; apply Rmult_le_compat_r; lra). lra.
Qed.
Lemma stopped j B : 0 <= B -> (forall x, sq (lap (edges G) x j) <= B * V (edges G) (ly f) x) -> / k G < b -> (j < N)%nat ->
  filterlim (fun t => X t 1%nat j) (at_left T) (locally 0).
Proof.
  intros HB H Hb Hj. set (mu := Rmin (b - / k G) (alpha c) / 2). assert (M : 0 < Rmin (b - / k G) (alpha c)) by (apply Rmin_pos; lra).
  pose proof (Rmin_l (b - / k G) (alpha c)) as M1. pose proof (Rmin_r (b - / k G) (alpha c)) as M2. destruct (T_k a Hprot) as [T0 K0]. fold G in K0.
  assert (M0 : 0 < mu) by (unfold mu; lra). assert (IM : 0 < / mu) by (apply Rinv_0_lt_compat; exact M0).
  set (s := sqrt B). assert (S0 : 0 <= s) by apply sqrt_pos. pose proof (eta_pos a Hprot Hgain 0 T0) as E00.
  assert (Q0 : 0 <= eta a 0 * u0 + d0 * / mu).
  { apply Rplus_le_le_0_compat; apply Rmult_le_pos; lra. }
  apply (dies_out _ (Rabs (lags c h X 0 j) + s * (eta a 0 * u0 + d0 * / mu)) mu M0).
  { pose proof (Rabs_pos (lags c h X 0 j)). pose proof (Rmult_le_pos _ _ S0 Q0). lra. }
  intros t Ht. pose proof (turns_pos a Hprot Hgain t Ht) as S1. pose proof (eta_pos a Hprot Hgain t (proj2 Ht)) as Et.
  rewrite <- (speed_at X t) by lra.
  assert (Ev : speed X t j = exp (- (alpha c * turns a t)) * lags c h X 0 j + - (eta a t * lap (edges G) (place h X t) j)).
  { pose proof (lags_die c h X Sl Hprot Hgain Hcap Hin HX t j Ht Hj) as LD. fold a in LD. rewrite <- LD. unfold lags, lp. fold a G. ring. }
  rewrite Ev. eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_Ropp, !Rabs_mult. set (e := exp (- (mu * turns a t))).
  assert (E0 : 0 < e) by apply exp_pos. rewrite (Rabs_right (exp _)) by (apply Rle_ge; left; apply exp_pos). rewrite (Rabs_right (eta a t)) by lra.
  rewrite Rmult_plus_distr_r. apply Rplus_le_compat.
  - rewrite Rmult_comm. apply Rmult_le_compat_l; [apply Rabs_pos|]. apply exp_le, Ropp_le_contravar, Rmult_le_compat_r; unfold mu; lra.
  - pose proof (size_of _ B _ HB (H (place h X t))) as L. fold s in L. pose proof (course_one h X Sl t HX Ht) as C. fold u0 d0 in C.
    pose proof (carried_fast mu t M0 ltac:(unfold mu; lra) ltac:(unfold mu; lra) Ht) as CF. fold e in CF.
    assert (P : eta a t * exp (- (b * turns a t)) <= eta a 0 * e).
    { pose proof (powers a Hprot Hgain 1 (/ k G) ltac:(simpl; fold G; rewrite Rinv_l; lra) t Ht) as W. rewrite !pow_1 in W.
      assert (Z : exp (- (b * turns a t)) = exp (- (/ k G * turns a t)) * exp (- ((b - / k G) * turns a t))) by (rewrite <- exp_plus; f_equal; ring).
      rewrite Z. rewrite <- Rmult_assoc, (Rmult_comm (eta a t)). apply Rmult_le_compat; [|left; apply exp_pos|exact W|].
      - apply Rmult_le_pos; [left; apply exp_pos|lra].
      - apply exp_le, Ropp_le_contravar, Rmult_le_compat_r; unfold mu; lra. }
    apply (Rmult_le_compat_l s) in C; [|exact S0]. pose proof (Rle_trans _ _ _ L C) as L2. apply (Rmult_le_compat_l (eta a t)) in L2; [|lra].
    eapply Rle_trans; [exact L2|]. apply (Rmult_le_compat_r u0) in P; [|exact pos_u0]. apply (Rmult_le_compat_r d0) in CF; [|exact pos_d0].
    replace (eta a t * (s * (exp (- (b * turns a t)) * u0 + d0 * carried c b t)))
      with (s * (eta a t * exp (- (b * turns a t)) * u0 + eta a t * carried c b t * d0)) by ring.
    replace (s * (eta a 0 * u0 + d0 * / mu) * e) with (s * (eta a 0 * e * u0 + / mu * e * d0)) by ring.
    apply Rmult_le_compat_l; [exact S0|]. lra.
Qed.
End Course.

(** * The common position *)
Section Common.
Variables (c : cascade) (h : nat -> R) (X : R -> nat -> nat -> R) (Sl : R -> nat -> R).
Let a := team c.
Let G := graph a.
Let N := order G.
Let T := deadline G.
Let d := prepare G.
Hypothesis Hedges : check_edges G (dls d) = true.
Hypothesis Hend : check_end G d = true.
Hypothesis Hprot : check_protocol G = true.
Hypothesis Hgain : positive_gain a.
Hypothesis Hcap : cap a = None.
Hypothesis Hin : forall e, In e (edges G) -> (tgt e < N)%nat /\ (src e < N)%nat.
Hypothesis HX : tracks c h X Sl.
Let far := glide a 0 (alpha c).
Hypothesis some : (0 < degree a)%nat.
Lemma lags_common t j : 0 <= t -> end_state G (lags c h X t) j = end_state G (speed X t) j.
Proof.
  intros Ht. unfold lags. rewrite (end_plus a (speed X t) (fun j => eta a t * lp c (place h X t) j)), (end_scal a (eta a t)).
  unfold lp. fold a G. rewrite (end_lap a Hedges Hend). fold G. ring.
Qed.
Lemma velocity_common t j : 0 <= t < T -> end_state G (speed X t) j = fades a 0 (alpha c) t * end_state G (speed X 0) j.
Proof.
  intros Ht. rewrite <- !lags_common by lra. unfold fades.
  assert (E : exp (alpha c * turns a t) * end_state G (lags c h X t) j = exp (alpha c * turns a 0) * end_state G (lags c h X 0) j).
  { apply (still T (fun u => exp (alpha c * turns a u) * end_state G (lags c h X u) j)); [| |exact Ht]; intros u Hu.
    - evar_last; [apply (is_derive_times (fun u => exp (alpha c * turns a u)) (fun u => end_state G (lags c h X u) j)); [apply (decays_derive c Hprot); apply Hu|]|].
      + apply (end_derive a Hend some (lags c h X) (fun j => - (alpha c * eta a u) * lags c h X u j)). intros i Hi.
        apply (lags_derive c h X Sl Hprot Hgain Hcap Hin HX u i Hu Hi).
      + rewrite (end_scal a). fold a G. ring.
    - apply (continuous_mult (fun u => exp (alpha c * turns a u)) (fun u => end_state G (lags c h X u) j)); [apply (decays_continuous c Hprot); apply Hu|].
      apply (end_continuous a Hend some (lags c h X)). intros i Hi. apply (lags_continuous c h X Sl Hin HX u i Hu Hi). }
  rewrite (turns_0 a), Rmult_0_r, exp_0, Rmult_1_l in E. rewrite <- E, <- Rmult_assoc, <- exp_plus.
  replace (- (0 * t + alpha c * turns a t) + alpha c * turns a t) with 0 by ring. rewrite exp_0. ring.
Qed.
Lemma position_common t j : 0 <= t < T -> end_state G (place h X t) j = end_state G (place h X 0) j + far t * end_state G (speed X 0) j.
Proof.
  intros Ht. set (v := end_state G (speed X 0) j).
  assert (E : end_state G (place h X t) j - far t * v = end_state G (place h X 0) j - far 0 * v).
  { apply (still T (fun u => end_state G (place h X u) j - far u * v)); [| |exact Ht]; intros u Hu.
    - evar_last; [apply (is_derive_minus (fun u => end_state G (place h X u) j) (fun u => far u * v))|].
      + apply (end_derive a Hend some (place h X) (speed X u)). intros i Hi. apply (place_derive c h X Sl HX u i Hu Hi).
      + apply (is_derive_times far (fun _ => v)); [apply (glide_derive a 0 (alpha c) Hprot); apply Hu|apply @is_derive_const].
      + fold a G. rewrite velocity_common by lra. fold v. unfold minus, plus, opp, zero; simpl. ring.
    - apply (continuous_minus (fun u => end_state G (place h X u) j) (fun u => far u * v)).
      + apply (end_continuous a Hend some (place h X)). intros i Hi. apply (place_continuous c h X Sl HX u i Hu Hi).
      + apply (continuous_mult far (fun _ => v)); [apply (glide_continuous a 0 (alpha c) Hprot); apply Hu|apply continuous_const]. }
  unfold far in E at 2. rewrite (glide_0 a 0 (alpha c)) in E. lra.
Qed.
End Common.
