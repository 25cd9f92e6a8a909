(** The input of the cascade: what it takes at most, in one coordinate of space. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia Psatz FunctionalExtensionality.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Slide Solution Main Weighted AgentCertificate AgentForms
  AgentMotion AgentEnd AgentRest CascadeCertificate CascadeMotion CascadeEnd.
Open Scope R_scope.

Section Input.
Variables (c : cascade) (f : func) (F : mat) (mm : Z).
Let a := team c.
Let G := graph a.
Let N := order G.
Let T := deadline G.
Let d := prepare G.
Hypothesis Hprot : check_protocol G = true.
Hypothesis Hgain : positive_gain a.
Hypothesis Hcap : cap a = None.
Hypothesis Hls : good (dls d) (map wt (edges G)) = true.
Hypothesis EF : Checker.form N (dls d) (dL d) (ly f) = Some (F, mm).
Hypothesis Hends : check_ends G d f = true.
Hypothesis Hrate : nonneg N (dsw d) (dfw d) (rate_form (dls d) (dL d) F (rate f)) = true.
Hypothesis Ha : 0 < alpha c.
Let S := pair (edges G) (ly f).
Let b := Q2R (rate f) / 2.
Let PS : positive S := pair_positive G f Hls F mm EF Hends.
Let kap := / k G.
Let a' := alpha c - kap.
Let b' := b - 2 * kap.
Hypothesis Ha' : 0 <= a'.
Hypothesis Hb' : 0 <= b'.
Hypothesis Hab : 0 < a' + b'.
Let s := turns a.
Let g := eta a.
Let th := theta c.
Variables (h : nat -> R) (X : R -> nat -> nat -> R) (Sl : R -> nat -> R).
Hypothesis HX : tracks c h X Sl.
Let x := place h X.
Let v := speed X.
Definition mixed t j := v t j / g t + (alpha c + th t) * x t j.
Let r := mixed.
Let T0 : 0 < T := proj1 (T_k a Hprot).
Let g_pos t : t < T -> 0 < g t := eta_pos a Hprot Hgain t.
Let Dth t := 2 * (1 - Q2R (slope a) / g t) * (Q2R (slope a) * th t) / k G.
Lemma theta_derive t : t < T -> is_derive th t (Dth t).
Proof.
  intros Ht. pose proof (g_pos t Ht) as E. pose proof (proj2 (T_k a Hprot)) as K0. fold G in K0. evar_last.
  - apply (is_derive_after (fun y => sq (1 - Q2R (slope a) / y) / k G) g t (2 * (1 - Q2R (slope a) / g t) * (Q2R (slope a) / sq (g t)) / k G) (th t * sq (g t)));
      [|apply (gain_derive c Hprot Hgain Hcap); exact Ht].
    unfold sq. auto_derive; [lra|]. field. lra.
  - unfold Dth, sq. field. lra.
Qed.
Lemma Dth_pos t : t < T -> 0 <= Dth t.
Proof.
  intros Ht. pose proof (g_pos t Ht) as E. pose proof (proj2 (T_k a Hprot)) as K0. fold G in K0. pose proof (proj1 Hgain) as R0.
  destruct (theta_ok c Hprot Hgain Hcap t Ht) as [T1 _]. pose proof (uncapped_pos a Hprot t Ht) as U. rewrite <- (free c Hcap) in U.
  assert (Z : 0 <= 1 - Q2R (slope a) / g t).
  { assert (Q2R (slope a) / g t <= 1); [|lra]. apply (Rmult_le_reg_r (g t)); [exact E|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. rewrite Rmult_1_r, Rmult_1_l. left. exact U. }
  unfold Dth, Rdiv. apply Rmult_le_pos; [|left; apply Rinv_0_lt_compat; exact K0]. apply Rmult_le_pos; [lra|]. apply Rmult_le_pos; [exact R0|exact T1].
Qed.
Lemma pulled_r t j : t < T -> lap (edges G) (r t) j = / g t * lap (edges G) (v t) j + (alpha c + th t) * lap (edges G) (x t) j.
Proof.
  intros Ht. pose proof (lap_two (edges G) (/ g t) (v t) (fun j => (alpha c + th t) * x t j) j) as L. rewrite lap_scal in L. rewrite <- L.
  f_equal. apply functional_extensionality. intros i. unfold r, mixed, Rdiv. ring.
Qed.
Lemma steer_r t j : 0 <= t < T -> steer c h (X t) t j = - (sq (g t) * lap (edges G) (r t) j) - alpha c * g t * v t j.
Proof.
  intros Ht. rewrite pulled_r by lra. pose proof (g_pos t (proj2 Ht)) as E. unfold steer. cbv zeta. unfold lp. fold a G.
  unfold x, v. rewrite place_at, speed_at by lra. fold g th. unfold sq. field. lra.
Qed.
Lemma r_derive t j : 0 < t < T -> (j < N)%nat -> is_derive (fun u => r u j) t (- (g t * lap (edges G) (r t) j) + Dth t * x t j).
Proof.
  intros Ht Hj. pose proof (g_pos t (proj2 Ht)) as E. evar_last.
  - apply (is_derive_plus (fun u => v u j / g u) (fun u => (alpha c + th u) * x u j)).
    + apply (is_derive_div (fun u => v u j) g); [apply (speed_derive c h X Sl Hprot HX t j Ht Hj)|apply (gain_derive c Hprot Hgain Hcap); apply Ht|].
      fold g. lra.
    + apply (is_derive_times (fun u => alpha c + th u) (fun u => x u j)); [|apply (place_derive c h X Sl HX t j Ht Hj)].
      apply (is_derive_plus (fun _ => alpha c) th); [apply @is_derive_const|apply theta_derive; apply Ht].
  - rewrite steer_r by lra. unfold plus, zero; simpl. fold a g th x v. unfold sq. field. lra.
Qed.
Lemma g_continuous t : t < T -> continuous g t.
Proof. apply (eta_continuous a). Qed.
Lemma th_continuous t : t < T -> continuous th t.
Proof. intros Ht. apply @ex_derive_continuous. eexists. apply theta_derive. exact Ht. Qed.
Lemma x_continuous t j : 0 <= t < T -> (j < N)%nat -> continuous (fun u => x u j) t.
Proof. apply (place_continuous c h X Sl HX). Qed.
Lemma r_continuous t j : 0 <= t < T -> (j < N)%nat -> continuous (fun u => r u j) t.
Proof.
  intros Ht Hj. pose proof (g_pos t (proj2 Ht)) as E. apply (continuous_plus (fun u => v u j / g u) (fun u => (alpha c + th u) * x u j)).
  - apply (continuous_mult (fun u => v u j) (fun u => / g u)); [apply (speed_continuous c h X Sl HX t j Ht Hj)|].
    apply (continuous_comp g Rinv); [apply g_continuous; apply Ht|apply continuous_Rinv; lra].
  - apply (continuous_mult (fun u => alpha c + th u) (fun u => x u j)); [|apply x_continuous; assumption].
    apply (continuous_plus (fun _ => alpha c) th); [apply continuous_const|apply th_continuous; apply Ht].
Qed.

(** * With a small part added to the values, roots can be derived *)
Section Small.
Variable ep : R.
Hypothesis Hep : 0 < ep.
Let p t := ep * exp (- b * s t).
Let q t := ep * (exp (- alpha c * s t) / g t).
Let WR t := S (r t) (r t) + p t * p t.
Let WS t := S (x t) (x t) + q t * q t.
Let RR t := sqrt (WR t).
Let SS t := sqrt (WS t).
Lemma p_derive t : t < T -> is_derive p t (- (b * g t) * p t).
Proof.
  intros Ht. evar_last; [apply is_derive_scal; apply (decays_derive c Hprot); exact Ht|]. unfold p, s, g. fold a. ring.
Qed.
Lemma q_derive t : t < T -> is_derive q t (- ((alpha c + th t) * g t) * q t).
Proof.
  intros Ht. pose proof (g_pos t Ht) as E. evar_last.
  - apply is_derive_scal. apply (is_derive_div (fun t => exp (- alpha c * s t)) g); [apply (decays_derive c Hprot); exact Ht|apply (gain_derive c Hprot Hgain Hcap); exact Ht|].
    fold g. lra.
  - unfold q. fold a g s th. unfold sq. field. lra.
Qed.
Lemma p_pos t : 0 < p t.
Proof. apply Rmult_lt_0_compat; [exact Hep|apply exp_pos]. Qed.
Lemma q_pos t : t < T -> 0 < q t.
Proof. intros Ht. apply Rmult_lt_0_compat; [exact Hep|]. apply Rdiv_lt_0_compat; [apply exp_pos|apply g_pos; exact Ht]. Qed.
Lemma WR_pos t : 0 < WR t.
Proof. pose proof (above0 S PS (r t)). pose proof (p_pos t). unfold WR. nra. Qed.
Lemma WS_pos t : t < T -> 0 < WS t.
Proof. intros Ht. pose proof (above0 S PS (x t)). pose proof (q_pos t Ht). unfold WS. nra. Qed.
Lemma RR_pos t : 0 < RR t. Proof. apply sqrt_lt_R0, WR_pos. Qed.
Lemma SS_pos t : t < T -> 0 < SS t. Proof. intros Ht. apply sqrt_lt_R0, WS_pos. exact Ht. Qed.
Lemma RR_sq t : RR t * RR t = WR t. Proof. apply sqrt_sqrt. left. apply WR_pos. Qed.
Lemma SS_sq t : t < T -> SS t * SS t = WS t. Proof. intros Ht. apply sqrt_sqrt. left. apply WS_pos. exact Ht. Qed.
Let dWR t := S (fun j => - (g t * lap (edges G) (r t) j) + Dth t * x t j) (r t) + S (r t) (fun j => - (g t * lap (edges G) (r t) j) + Dth t * x t j)
  + 2 * (- (b * g t) * p t * p t).
Let dWS t := S (v t) (x t) + S (x t) (v t) + 2 * (- ((alpha c + th t) * g t) * q t * q t).
Lemma RR_derive t : 0 < t < T -> is_derive RR t (dWR t / (2 * RR t)).
Proof.
  intros Ht. apply (root_derive WR t (dWR t)); [apply WR_pos|]. unfold WR, dWR. apply (is_derive_plus (fun t => S (r t) (r t)) (fun t => p t * p t)).
  - apply (pair_derive G f Hls F mm EF r r); intros j Hj; apply r_derive; assumption.
  - evar_last; [apply (is_derive_times p p); apply p_derive; apply Ht|]. ring.
Qed.
Lemma SS_derive t : 0 < t < T -> is_derive SS t (dWS t / (2 * SS t)).
Proof.
  intros Ht. apply (root_derive WS t (dWS t)); [apply WS_pos; apply Ht|]. unfold WS, dWS. apply (is_derive_plus (fun t => S (x t) (x t)) (fun t => q t * q t)).
  - apply (pair_derive G f Hls F mm EF x x); intros j Hj; apply (place_derive c h X Sl HX t j Ht Hj).
  - evar_last; [apply (is_derive_times q q); apply q_derive; apply Ht|]. ring.
Qed.
Lemma root_continuous (W : R -> R) t : continuous W t -> continuous (fun u => sqrt (W u)) t.
Proof. intros C. apply (continuous_comp W sqrt); [exact C|apply continuous_sqrt]. Qed.
Lemma square_continuous (W : R -> R) t dw : is_derive W t dw -> continuous (fun u => W u * W u) t.
Proof. intros D. assert (C : continuous W t) by (apply @ex_derive_continuous; eexists; exact D). apply (continuous_mult W W); exact C. Qed.
Lemma RR_continuous t : 0 <= t < T -> continuous RR t.
Proof.
  intros Ht. apply root_continuous. apply (continuous_plus (fun t => S (r t) (r t)) (fun t => p t * p t)).
  - apply (pair_continuous G f Hls F mm EF r r); intros j Hj; apply r_continuous; assumption.
  - eapply square_continuous. apply p_derive. apply Ht.
Qed.
Lemma SS_continuous t : 0 <= t < T -> continuous SS t.
Proof.
  intros Ht. apply root_continuous. apply (continuous_plus (fun t => S (x t) (x t)) (fun t => q t * q t)).
  - apply (pair_continuous G f Hls F mm EF x x); intros j Hj; apply x_continuous; assumption.
  - eapply square_continuous. apply q_derive. apply Ht.
Qed.
Lemma cross_below t : t < T -> S (x t) (r t) <= SS t * RR t.
Proof.
  intros Ht. eapply Rle_trans; [apply (cross S PS)|]. apply Rmult_le_compat; try apply sqrt_pos; apply sqrt_le_1_alt;
    [pose proof (q_pos t Ht); unfold WS|pose proof (p_pos t); unfold WR]; nra.
Qed.
Lemma RR_slope t : 0 <= t < T -> dWR t / (2 * RR t) <= Dth t * SS t - b * g t * RR t.
Proof.
  intros Ht. pose proof (RR_pos t) as P. pose proof (g_pos t (proj2 Ht)) as E. apply (Rmult_le_reg_r (2 * RR t)); [lra|].
  unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. rewrite Rmult_1_r. unfold dWR.
  assert (Ed : (fun j => - (g t * lap (edges G) (r t) j) + Dth t * x t j) = fun j => - g t * lap (edges G) (r t) j + Dth t * x t j)
    by (apply functional_extensionality; intros; ring). rewrite Ed, (swaps S PS (r t)), (adds S PS), !(scales S PS).
  pose proof (pair_rate G f Hls F mm EF Hrate (r t)) as C. fold G S in C. apply (Rmult_le_compat_l (g t)) in C; [|lra].
  pose proof (cross_below t (proj2 Ht)) as C2. apply (Rmult_le_compat_l (Dth t)) in C2; [|apply Dth_pos; apply Ht].
  replace ((Dth t * SS t - b * g t * RR t) * (2 * RR t)) with (2 * (Dth t * (SS t * RR t)) - 2 * b * g t * (RR t * RR t)) by ring.
  rewrite RR_sq. unfold WR. unfold b in *. lra.
Qed.
Lemma SS_slope t : 0 <= t < T -> dWS t / (2 * SS t) <= g t * RR t - (alpha c + th t) * g t * SS t.
Proof.
  intros Ht. pose proof (SS_pos t (proj2 Ht)) as P. pose proof (g_pos t (proj2 Ht)) as E. apply (Rmult_le_reg_r (2 * SS t)); [lra|].
  unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. rewrite Rmult_1_r. unfold dWS.
  assert (Ev : v t = fun j => g t * r t j + - (g t * (alpha c + th t)) * x t j).
  { apply functional_extensionality. intros j. unfold r, mixed. field. lra. }
  rewrite Ev, (swaps S PS (x t)), (adds S PS), !(scales S PS), (swaps S PS (r t)).
  pose proof (cross_below t (proj2 Ht)) as C2. apply (Rmult_le_compat_l (g t)) in C2; [|lra].
  replace ((g t * RR t - (alpha c + th t) * g t * SS t) * (2 * SS t)) with (2 * (g t * (SS t * RR t)) - 2 * (alpha c + th t) * g t * (SS t * SS t)) by ring.
  rewrite SS_sq by apply Ht. unfold WS. lra.
Qed.
(** what the velocity collects *)
Let inner t := exp (alpha c * s t) * (sq (g t) * RR t).
Let H t := RInt (fun u => inner (Rmax 0 u)) 0 t.
Let J t := g t * (exp (- alpha c * s t) * H t).
Lemma inner_continuous t : 0 <= t < T -> continuous inner t.
Proof.
  intros Ht. apply (continuous_mult (fun t => exp (alpha c * s t)) (fun t => sq (g t) * RR t)); [apply (decays_continuous c Hprot); apply Ht|].
  apply (continuous_mult (fun t => sq (g t)) RR); [|apply RR_continuous; exact Ht].
  apply (continuous_mult g g); apply g_continuous; apply Ht.
Qed.
Lemma cut_continuous t : t < T -> continuous (fun u => inner (Rmax 0 u)) t.
Proof.
  intros Ht. apply (continuous_comp (Rmax 0) inner); [apply continuous_Rmax|]. apply inner_continuous. split; [apply Rmax_l|].
  apply Rmax_lub_lt; [exact T0|exact Ht].
Qed.
Lemma H_derive t : 0 <= t < T -> is_derive H t (inner t).
Proof.
  intros Ht. evar_last; [apply (primitive (fun u => inner (Rmax 0 u)) T T0 cut_continuous t (proj2 Ht))|]. cbv beta. rewrite Rmax_right by lra. reflexivity.
Qed.
Lemma H_0 : H 0 = 0. Proof. apply (RInt_point 0 (fun u => inner (Rmax 0 u))). Qed.
Lemma H_pos t : 0 <= t < T -> 0 <= H t.
Proof.
  intros Ht. apply RInt_ge_0; [apply Ht| |].
  - apply (ex_RInt_continuous (fun u => inner (Rmax 0 u))). intros z [_ Hz]. apply cut_continuous.
    eapply Rle_lt_trans; [exact Hz|]. apply Rmax_lub_lt; [exact T0|apply Ht].
  - intros u _. unfold inner. apply Rmult_le_pos; [left; apply exp_pos|]. apply Rmult_le_pos; [apply Rle_0_sqr|left; apply RR_pos].
Qed.
Lemma J_derive t : 0 <= t < T -> is_derive J t (g t * ((th t - alpha c) * J t + sq (g t) * RR t)).
Proof.
  intros Ht. evar_last.
  - apply (is_derive_times g (fun t => exp (- alpha c * s t) * H t)); [apply (gain_derive c Hprot Hgain Hcap); apply Ht|].
    apply (is_derive_times (fun t => exp (- alpha c * s t)) H); [apply (decays_derive c Hprot); apply Ht|apply H_derive; exact Ht].
  - unfold J, inner. fold a g s th.
    assert (E : exp (- alpha c * s t) * exp (alpha c * s t) = 1) by (rewrite <- exp_plus; replace (- alpha c * s t + alpha c * s t) with 0 by ring; apply exp_0).
    set (e := exp (- alpha c * s t)) in *. set (e2 := exp (alpha c * s t)) in *. unfold sq.
    replace (th t * (g t * g t) * (e * H t) + g t * (- alpha c * g t * e * H t + e * (e2 * (g t * g t * RR t))))
      with (th t * (g t * g t) * (e * H t) + g t * (- alpha c * g t * e * H t + e * e2 * (g t * g t * RR t))) by ring. rewrite E. ring.
Qed.
Lemma J_pos t : 0 <= t < T -> 0 <= J t.
Proof.
  intros Ht. pose proof (g_pos t (proj2 Ht)). unfold J. apply Rmult_le_pos; [lra|]. apply Rmult_le_pos; [left; apply exp_pos|apply H_pos; exact Ht].
Qed.
Lemma J_0 : J 0 = 0. Proof. unfold J. rewrite H_0. ring. Qed.
Lemma J_continuous t : 0 <= t < T -> continuous J t.
Proof. intros Ht. apply @ex_derive_continuous. eexists. apply J_derive. exact Ht. Qed.
Let Phi t := sq (g t) * (RR t + (kap - th t) * SS t) + b' * J t.
Let F0 := sq (g 0) * (RR 0 + (kap - th 0) * SS 0).
Lemma th_below t : t < T -> 0 <= th t <= kap.
Proof. apply (theta_ok c Hprot Hgain Hcap). Qed.
Lemma Phi_falls t : 0 <= t < T -> Phi t <= F0.
Proof.
  intros Ht. assert (E0 : Phi 0 = F0) by (unfold Phi, F0; rewrite J_0; ring). rewrite <- E0.
  apply (decreasing T 0 Phi (fun t => 2 * (th t * sq (g t)) * g t * (RR t + (kap - th t) * SS t)
    + sq (g t) * (dWR t / (2 * RR t) + ((0 - Dth t) * SS t + (kap - th t) * (dWS t / (2 * SS t))))
    + b' * (g t * ((th t - alpha c) * J t + sq (g t) * RR t)))); [| | |exact Ht]; clear t Ht; intros t Ht.
  - apply (is_derive_plus (fun t => sq (g t) * (RR t + (kap - th t) * SS t)) (fun t => b' * J t)); [|apply is_derive_scal; apply J_derive; lra].
    apply (is_derive_times (fun t => sq (g t)) (fun t => RR t + (kap - th t) * SS t)).
    + evar_last; [apply (is_derive_times g g); apply (gain_derive c Hprot Hgain Hcap); apply Ht|]. fold a g th. ring.
    + apply (is_derive_plus RR (fun t => (kap - th t) * SS t)); [apply RR_derive; exact Ht|].
      apply (is_derive_times (fun t => kap - th t) SS); [|apply SS_derive; exact Ht].
      apply (is_derive_minus (fun _ => kap) th); [apply @is_derive_const|apply theta_derive; apply Ht].
  - apply (continuous_plus (fun t => sq (g t) * (RR t + (kap - th t) * SS t)) (fun t => b' * J t)).
    + apply (continuous_mult (fun t => sq (g t)) (fun t => RR t + (kap - th t) * SS t)); [apply (continuous_mult g g); apply g_continuous; apply Ht|].
      apply (continuous_plus RR (fun t => (kap - th t) * SS t)); [apply RR_continuous; exact Ht|].
      apply (continuous_mult (fun t => kap - th t) SS); [|apply SS_continuous; exact Ht].
      apply (continuous_minus (fun _ => kap) th); [apply continuous_const|apply th_continuous; apply Ht].
    + apply (continuous_mult (fun _ => b') J); [apply continuous_const|apply J_continuous; exact Ht].
  - pose proof (RR_slope t Ht) as A1. pose proof (SS_slope t Ht) as A2. destruct (th_below t (proj2 Ht)) as [T1 T2].
    pose proof (g_pos t (proj2 Ht)) as E. pose proof (RR_pos t) as P1. pose proof (SS_pos t (proj2 Ht)) as P2. pose proof (J_pos t Ht) as P3.
    set (dR := dWR t / (2 * RR t)) in *. set (dS := dWS t / (2 * SS t)) in *. unfold sq. set (e := g t) in *. set (y := th t) in *.
    apply (Rmult_le_compat_l (kap - y)) in A2; [|lra].
    assert (A3 : e * e * (dR + ((0 - Dth t) * SS t + (kap - y) * dS)) <= e * e * ((Dth t * SS t - b * e * RR t) + ((0 - Dth t) * SS t +
      (kap - y) * (e * RR t - (alpha c + y) * e * SS t)))) by (apply Rmult_le_compat_l; [apply Rle_0_sqr|lra]).
    assert (B1 : 0 <= e * (e * e * RR t) * (kap - y)) by (repeat apply Rmult_le_pos; lra).
    assert (AY : 0 <= alpha c - y) by (pose proof Ha' as Q; unfold a' in Q; lra).
    assert (B2 : 0 <= e * (e * e * SS t) * (kap - y) * (alpha c - y)) by (repeat apply Rmult_le_pos; lra).
    assert (B3 : 0 <= e * b' * J t * (alpha c - y)) by (apply Rmult_le_pos; [apply Rmult_le_pos; [apply Rmult_le_pos; [lra|exact Hb']|exact P3]|exact AY]).
    eapply Rle_trans; [apply Rplus_le_compat_r; apply Rplus_le_compat_l; exact A3|]. unfold b' in *.
    match goal with |- ?w <= 0 => replace w with (- (e * (e * e * RR t) * (kap - y)) - e * (e * e * SS t) * (kap - y) * (alpha c - y) - e * (b - 2 * kap) * J t * (alpha c - y)) by ring end. lra.
Qed.
Lemma F0_pos : 0 <= F0.
Proof.
  destruct (th_below 0 T0) as [_ K]. pose proof (RR_pos 0). pose proof (SS_pos 0 T0). unfold F0. apply Rmult_le_pos; [apply Rle_0_sqr|].
  assert (0 <= (kap - th 0) * SS 0) by (apply Rmult_le_pos; lra). lra.
Qed.
Lemma spent t : 0 <= t < T -> sq (g t) * RR t <= F0 - b' * J t.
Proof.
  intros Ht. pose proof (Phi_falls t Ht) as P. unfold Phi in P. destruct (th_below t (proj2 Ht)) as [_ K]. pose proof (SS_pos t (proj2 Ht)) as Q.
  assert (0 <= sq (g t) * ((kap - th t) * SS t)) by (apply Rmult_le_pos; [apply Rle_0_sqr|apply Rmult_le_pos; lra]). lra.
Qed.
Lemma J_below t : 0 <= t < T -> J t <= F0 / (a' + b').
Proof.
  intros Ht. set (z := a' + b'). fold z in Hab. set (K := F0 / z). assert (EK : z * K = F0) by (unfold K; field; lra).
  assert (K0 : 0 <= K) by (apply Rmult_le_pos; [apply F0_pos|left; apply Rinv_0_lt_compat; exact Hab]).
  assert (D : exp (z * s t) * (J t - K) <= exp (z * s 0) * (J 0 - K)).
  { apply (decreasing T 0 (fun t => exp (z * s t) * (J t - K)) (fun t => z * g t * exp (z * s t) * (J t - K)
      + exp (z * s t) * (g t * ((th t - alpha c) * J t + sq (g t) * RR t) - 0))); [| | |exact Ht]; clear t Ht; intros t Ht.
    - apply (is_derive_times (fun t => exp (z * s t)) (fun t => J t - K)); [apply (decays_derive c Hprot); apply Ht|].
      apply (is_derive_minus J (fun _ => K)); [apply J_derive; lra|apply @is_derive_const].
    - apply (continuous_mult (fun t => exp (z * s t)) (fun t => J t - K)); [apply (decays_continuous c Hprot); apply Ht|].
      apply (continuous_minus J (fun _ => K)); [apply J_continuous; exact Ht|apply continuous_const].
    - pose proof (spent t Ht) as P. pose proof (g_pos t (proj2 Ht)) as E. pose proof (J_pos t Ht) as P3. destruct (th_below t (proj2 Ht)) as [_ T2].
      pose proof (exp_pos (z * s t)) as X0. set (e := exp (z * s t)) in *.
      replace (z * g t * e * (J t - K) + e * (g t * ((th t - alpha c) * J t + sq (g t) * RR t) - 0))
        with (e * g t * ((z + th t - alpha c) * J t + sq (g t) * RR t - z * K)) by ring. rewrite EK.
      assert (0 <= (kap - th t) * J t) by (apply Rmult_le_pos; lra). assert (W : (z + th t - alpha c) * J t + sq (g t) * RR t - F0 <= 0) by (unfold z, a' in *; lra).
      assert (0 < e * g t) by (apply Rmult_lt_0_compat; assumption). set (w := (z + th t - alpha c) * J t + sq (g t) * RR t - F0) in *. nra. }
  unfold s in D at 2. rewrite J_0, (turns_0 a), Rmult_0_r, exp_0 in D. pose proof (exp_pos (z * s t)) as E.
  destruct (Rle_lt_dec (J t) K) as [|L]; [assumption|]. assert (0 < exp (z * s t) * (J t - K)) by (apply Rmult_lt_0_compat; lra). lra.
Qed.
Let M := Rmax 1 ((a' + alpha c) / (a' + b')).
Lemma both t : 0 <= t < T -> sq (g t) * RR t + alpha c * J t <= F0 * M.
Proof.
  intros Ht. pose proof (spent t Ht) as P. pose proof (J_below t Ht) as Q. pose proof (J_pos t Ht) as Q0. pose proof F0_pos as F1.
  pose proof (Rmax_l 1 ((a' + alpha c) / (a' + b'))) as M1. pose proof (Rmax_r 1 ((a' + alpha c) / (a' + b'))) as M2. fold M in M1, M2.
  destruct (Rle_lt_dec (alpha c) b') as [L|L].
  - assert (alpha c * J t <= b' * J t) by (apply Rmult_le_compat_r; lra). assert (F0 * 1 <= F0 * M) by (apply Rmult_le_compat_l; lra). lra.
  - apply (Rmult_le_compat_l (alpha c - b')) in Q; [|lra]. apply (Rmult_le_compat_l F0) in M2; [|exact F1].
    replace (F0 * ((a' + alpha c) / (a' + b'))) with (F0 + (alpha c - b') * (F0 / (a' + b'))) in M2 by (field; lra). lra.
Qed.
Variables (j : nat) (C : R).
Hypothesis Hj : (j < N)%nat.
Hypothesis HC : 0 <= C.
Hypothesis Hconst : forall y, Rabs (lap (edges G) y j) <= C * sqrt (V (edges G) (ly f) y).
Lemma lap_below t : Rabs (lap (edges G) (r t) j) <= C * RR t.
Proof.
  eapply Rle_trans; [apply Hconst|]. apply Rmult_le_compat_l; [exact HC|]. apply sqrt_le_1_alt. rewrite <- (pair_self G f Hls F mm EF). fold G S.
  pose proof (p_pos t). unfold WR. nra.
Qed.
Lemma speed_below t : 0 <= t < T -> Rabs (v t j) <= exp (- alpha c * s t) * (Rabs (v 0 j) + C * H t).
Proof.
  intros Ht. assert (E : exp (- alpha c * s t) * exp (alpha c * s t) = 1) by (rewrite <- exp_plus; replace (- alpha c * s t + alpha c * s t) with 0 by ring; apply exp_0).
  assert (K : forall w, w = 1 \/ w = -1 -> w * (exp (alpha c * s t) * v t j) <= Rabs (v 0 j) + C * H t).
  { intros w Hw. assert (D : w * (exp (alpha c * s t) * v t j) - C * H t <= w * (exp (alpha c * s 0) * v 0 j) - C * H 0).
    { apply (decreasing T 0 (fun t => w * (exp (alpha c * s t) * v t j) - C * H t)
        (fun t => w * (alpha c * g t * exp (alpha c * s t) * v t j + exp (alpha c * s t) * steer c h (X t) t j) - C * inner t)); [| | |exact Ht]; intros u Hu.
      - apply (is_derive_minus (fun t => w * (exp (alpha c * s t) * v t j)) (fun t => C * H t)); apply is_derive_scal; [|apply H_derive; lra].
        apply (is_derive_times (fun t => exp (alpha c * s t)) (fun t => v t j)); [apply (decays_derive c Hprot); apply Hu|apply (speed_derive c h X Sl Hprot HX u j Hu Hj)].
      - apply (continuous_minus (fun t => w * (exp (alpha c * s t) * v t j)) (fun t => C * H t)).
        + apply (continuous_mult (fun _ => w)); [apply continuous_const|]. apply (continuous_mult (fun t => exp (alpha c * s t)) (fun t => v t j));
            [apply (decays_continuous c Hprot); apply Hu|apply (speed_continuous c h X Sl HX u j Hu Hj)].
        + apply (continuous_mult (fun _ => C)); [apply continuous_const|]. apply @ex_derive_continuous. eexists. apply H_derive. exact Hu.
      - rewrite steer_r by exact Hu. unfold inner. pose proof (lap_below u) as L. pose proof (exp_pos (alpha c * s u)) as X0. set (e := exp (alpha c * s u)) in *.
        set (l := lap (edges G) (r u) j) in *. pose proof (Rle_abs l) as L1. pose proof (Rle_abs (- l)) as L2. rewrite Rabs_Ropp in L2.
        assert (Z : 0 <= e * sq (g u)) by (apply Rmult_le_pos; [lra|apply Rle_0_sqr]).
        assert (W : - (w * l) <= C * RR u) by (destruct Hw as [-> | ->]; lra). apply (Rmult_le_compat_l (e * sq (g u))) in W; [|exact Z]. lra. }
    unfold s in D at 2. rewrite H_0, (turns_0 a), Rmult_0_r, exp_0 in D. pose proof (Rle_abs (v 0 j)). pose proof (Rle_abs (- v 0 j)) as L2. rewrite Rabs_Ropp in L2.
    destruct Hw as [-> | ->]; lra. }
  pose proof (K 1 ltac:(left; reflexivity)) as K1. pose proof (K (-1) ltac:(right; reflexivity)) as K2.
  replace (v t j) with (exp (- alpha c * s t) * (exp (alpha c * s t) * v t j)) by (rewrite <- Rmult_assoc, E; ring).
  rewrite Rabs_mult, Rabs_right by (apply Rle_ge; left; apply exp_pos). apply Rmult_le_compat_l; [left; apply exp_pos|]. apply Rabs_le. lra.
Qed.
Lemma input_small t : 0 <= t < T -> Rabs (steer c h (X t) t j) <= C * (F0 * M) + alpha c * (g 0 * Rabs (v 0 j)).
Proof.
  intros Ht. rewrite steer_r by exact Ht. pose proof (lap_below t) as L. pose proof (speed_below t Ht) as P. pose proof (both t Ht) as B.
  pose proof (g_pos t (proj2 Ht)) as E.
  assert (Q : g t * exp (- alpha c * s t) <= g 0).
  { pose proof (proj2 (T_k a Hprot)) as K0. fold G in K0. assert (KA : 1 <= alpha c * k G).
    { unfold a', kap in Ha'. apply (Rmult_le_compat_r (k G)) in Ha'; [|lra]. rewrite Rmult_0_l, Rmult_minus_distr_r, Rinv_l in Ha'; lra. }
    pose proof (powers a Hprot Hgain 1 (alpha c) ltac:(simpl; exact KA) t Ht) as W. rewrite !pow_1 in W. unfold g, s.
    replace (- alpha c * turns a t) with (- (alpha c * turns a t)) by ring. lra. }
  unfold Rminus. eapply Rle_trans; [apply Rabs_triang|]. rewrite !Rabs_Ropp, !Rabs_mult, (Rabs_right (alpha c)), (Rabs_right (g t)) by lra.
  rewrite (Rabs_right (sq (g t))) by (apply Rle_ge, Rle_0_sqr). apply (Rmult_le_compat_l (sq (g t))) in L; [|apply Rle_0_sqr].
  apply (Rmult_le_compat_l (alpha c * g t)) in P; [|apply Rmult_le_pos; lra]. apply (Rmult_le_compat_l C) in B; [|exact HC].
  apply (Rmult_le_compat_r (alpha c * Rabs (v 0 j))) in Q; [|apply Rmult_le_pos; [lra|apply Rabs_pos]].
  replace (alpha c * g t * (exp (- alpha c * s t) * (Rabs (v 0 j) + C * H t)))
    with (g t * exp (- alpha c * s t) * (alpha c * Rabs (v 0 j)) + C * (alpha c * J t)) in P by (unfold J; ring). lra.
Qed.
End Small.
Theorem input_below j C t : (j < N)%nat -> 0 <= C -> (forall y, Rabs (lap (edges G) y j) <= C * sqrt (V (edges G) (ly f) y)) -> 0 <= t < T ->
  Rabs (steer c h (X t) t j) <= C * Rmax 1 ((a' + alpha c) / (a' + b')) * sq (g 0) * sqrt (V (edges G) (ly f) (r 0)) +
    C * Rmax 1 ((a' + alpha c) / (a' + b')) * sq (g 0) * (kap - th 0) * sqrt (V (edges G) (ly f) (x 0)) + alpha c * g 0 * Rabs (v 0 j).
Proof.
  intros Hj HC HV Ht. set (M := Rmax 1 _). pose proof (Rmax_l 1 ((a' + alpha c) / (a' + b'))) as M1. fold M in M1.
  pose proof (g_pos 0 T0) as E. destruct (theta_ok c Hprot Hgain Hcap 0 T0) as [_ K]. fold a G kap th in K.
  assert (E2 : 0 <= sq (g 0)) by apply Rle_0_sqr. assert (IE : 0 < / g 0) by (apply Rinv_0_lt_compat; exact E).
  apply le_epsilon. intros e He. set (B := C * (sq (g 0) * (1 + (kap - th 0) * / g 0) * M)).
  assert (B0 : 0 <= B).
  { unfold B. apply Rmult_le_pos; [exact HC|]. apply Rmult_le_pos; [|lra]. apply Rmult_le_pos; [exact E2|].
    assert (0 <= (kap - th 0) * / g 0) by (apply Rmult_le_pos; lra). lra. }
  set (ep := e / (B + 1)). assert (Hep : 0 < ep) by (apply Rdiv_lt_0_compat; lra).
  assert (Be : B * ep <= e).
  { assert (Q : (B + 1) * ep = e) by (unfold ep; field; lra). lra. }
  pose proof (input_small ep Hep j C Hj HC HV t Ht) as I. eapply Rle_trans; [exact I|]. clear I. fold M.
  unfold s. rewrite (turns_0 a), !Rmult_0_r, exp_0. rewrite !(pair_self G f Hls F mm EF). fold G.
  set (V1 := V (edges G) (ly f) (r 0)). set (V2 := V (edges G) (ly f) (x 0)).
  assert (P1 : 0 <= V1) by apply (V_pos c f F mm Hls EF Hends). assert (P2 : 0 <= V2) by apply (V_pos c f F mm Hls EF Hends).
  pose proof (proj2 (root_near V1 (ep * 1) P1 ltac:(lra))) as R1.
  assert (Hq : 0 < ep * (1 / g 0)) by (apply Rmult_lt_0_compat; [exact Hep|]; unfold Rdiv; lra).
  pose proof (proj2 (root_near V2 (ep * (1 / g 0)) P2 Hq)) as R2. apply (Rmult_le_compat_l (kap - th 0)) in R2; [|lra].
  set (z1 := sqrt (V1 + _)) in *. set (z2 := sqrt (V2 + _)) in *.
  assert (A : C * (sq (g 0) * (z1 + (kap - th 0) * z2) * M) <= C * (sq (g 0) * (sqrt V1 + ep * 1 + (kap - th 0) * (sqrt V2 + ep * (1 / g 0))) * M)).
  { apply Rmult_le_compat_l; [exact HC|]. apply Rmult_le_compat_r; [lra|]. apply Rmult_le_compat_l; [exact E2|]. lra. }
  replace (C * (sq (g 0) * (sqrt V1 + ep * 1 + (kap - th 0) * (sqrt V2 + ep * (1 / g 0))) * M))
    with (C * M * sq (g 0) * sqrt V1 + C * M * sq (g 0) * (kap - th 0) * sqrt V2 + B * ep) in A by (unfold B, Rdiv; ring). lra.
Qed.
End Input.

(** * Over space *)
Definition size m (u : nat -> R) : R := sqrt (sum m (fun i => sq (u i))).
Lemma size_plus m u p : size m (fun i => u i + p i) <= size m u + size m p.
Proof.
  pose proof (sqrt_pos (sum m (fun i => sq (u i)))) as A. pose proof (sqrt_pos (sum m (fun i => sq (p i)))) as B. fold (size m u) (size m p) in A, B.
  pose proof (above0 _ (dot_positive m) u) as U. pose proof (above0 _ (dot_positive m) p) as W. cbv beta in U, W.
  change (fun i => u i * u i) with (fun i => sq (u i)) in U. change (fun i => p i * p i) with (fun i => sq (p i)) in W.
  rewrite <- (sqrt_square (size m u + size m p)) by lra. apply sqrt_le_1_alt.
  pose proof (cross _ (dot_positive m) u p) as C. cbv beta in C. change (sqrt (sum m (fun i => u i * u i))) with (size m u) in C. change (sqrt (sum m (fun i => p i * p i))) with (size m p) in C.
  rewrite (sum_ext m _ (fun i => sq (u i) + (2 * (u i * p i) + sq (p i)))) by (intros; unfold sq; ring). rewrite !sum_plus, sum_scal.
  assert (E1 : size m u * size m u = sum m (fun i => sq (u i))) by (apply sqrt_sqrt; exact U).
  assert (E2 : size m p * size m p = sum m (fun i => sq (p i))) by (apply sqrt_sqrt; exact W). rewrite <- E1, <- E2. nra.
Qed.
Lemma size_scal m q u : 0 <= q -> size m (fun i => q * u i) = q * size m u.
Proof.
  intros Hq. unfold size. rewrite (sum_ext m _ (fun i => q * q * sq (u i))) by (intros; unfold sq; ring). rewrite sum_scal.
  rewrite sqrt_mult_alt by (apply Rle_0_sqr). rewrite sqrt_square by exact Hq. reflexivity.
Qed.
Lemma size_le m u p : (forall i, (i < m)%nat -> Rabs (u i) <= p i) -> size m u <= size m p.
Proof.
  intros H. apply sqrt_le_1_alt. apply sum_le. intros i Hi. specialize (H i Hi). unfold sq. rewrite <- (Rabs_right (u i * u i)) by (apply Rle_ge, Rle_0_sqr).
  rewrite Rabs_mult. apply Rmult_le_compat; try apply Rabs_pos; exact H.
Qed.
