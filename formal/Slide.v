(** Proposition 1: whatever the disturbance, sliding variables shrink, and are 0 from [T_r] on. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Certificate Checker Sound.
Open Scope R_scope.

(** a continuous function that goes below 0 at no zero *)
Lemma stays (a b : R) (g : R -> R) : a <= b -> (forall t, a <= t <= b -> continuous g t) -> 0 <= g a ->
  (forall t, a <= t < b -> g t = 0 -> exists e, 0 < e /\ forall h, 0 < h < e -> 0 <= g (t + h)) -> 0 <= g b.
Proof.
  intros Hab C A H. set (E := fun t => a <= t <= b /\ forall u, a <= u <= t -> 0 <= g u).
  assert (Ea : E a) by (split; [lra|]; intros u Hu; replace u with a by lra; exact A).
  destruct (completeness E) as [s [U L]]; [exists b; intros t [Ht _]; lra|exists a; exact Ea|].
  assert (As : a <= s) by (apply U; exact Ea). assert (Sb : s <= b) by (apply L; intros t [Ht _]; lra).
  assert (B : forall u, a <= u < s -> 0 <= g u).
  { intros u Hu. destruct (Rle_lt_dec 0 (g u)) as [|N]; [assumption|]. exfalso.
    assert (s <= u); [|lra]. apply L. intros t [Ht K]. destruct (Rle_lt_dec t u); [assumption|].
    specialize (K u ltac:(lra)). lra. }
  assert (Near : forall e, 0 < e -> exists r, 0 < r /\ forall u, Rabs (u - s) < r -> Rabs (g u - g s) < e).
  { intros e He. assert (Cs : continuous g s) by (apply C; lra).
    destruct (proj1 (filterlim_locally g (g s)) Cs (mkposreal e He)) as [r Hr].
    exists r. split; [apply cond_pos|]. intros u Hu. exact (Hr u Hu). }
  assert (Gs : 0 <= g s).
  { destruct (Rle_lt_dec 0 (g s)) as [|N]; [assumption|]. exfalso. destruct (Near (- g s) ltac:(lra)) as [r [Hr K]].
    destruct (Req_dec s a) as [E1|Ns]; [rewrite E1 in N; lra|]. pose proof (Rmax_l a (s - r / 2)) as M1.
    pose proof (Rmax_r a (s - r / 2)) as M2. assert (M3 : Rmax a (s - r / 2) < s) by (apply Rmax_lub_lt; lra).
    set (u := Rmax a (s - r / 2)) in *. specialize (B u ltac:(lra)).
    specialize (K u ltac:(apply Rabs_def1; lra)). apply Rabs_def2 in K. lra. }
  destruct (Req_dec s b) as [<-|Nb]; [exact Gs|]. exfalso.
  assert (X : exists e, 0 < e /\ forall h, 0 < h < e -> 0 <= g (s + h)).
  { destruct Gs as [G|G]; [|apply H; [lra|symmetry; exact G]]. destruct (Near (g s) G) as [r [Hr K]].
    exists r. split; [exact Hr|]. intros h Hh. specialize (K (s + h) ltac:(apply Rabs_def1; lra)). apply Rabs_def2 in K. lra. }
  destruct X as [e [He K]]. assert (Hh : 0 < Rmin (e / 2) (b - s)) by (apply Rmin_pos; lra).
  pose proof (Rmin_l (e / 2) (b - s)) as M1. pose proof (Rmin_r (e / 2) (b - s)) as M2. set (h := Rmin (e / 2) (b - s)) in *.
  assert (s + h <= s); [|lra]. apply U. split; [lra|]. intros u Hu. destruct (Rlt_le_dec u s); [apply B; lra|].
  destruct (Req_dec u s) as [->|]; [exact Gs|]. replace u with (s + (u - s)) by ring. apply K. lra.
Qed.

Lemma Qpos q : pos q = true -> 0 < Q2R q.
Proof.
  intros H. apply Z.ltb_lt in H. unfold Q2R. apply Rmult_lt_0_compat; [apply IZR_lt; exact H|].
  apply Rinv_0_lt_compat. apply IZR_lt. reflexivity.
Qed.
Lemma T_pos c : check_protocol c = true -> 0 < deadline c /\ 0 < Q2R (rho1 c) /\ 0 < k c.
Proof.
  intros Hprot. unfold check_protocol in Hprot. apply andb_prop in Hprot as [H H4]. apply andb_prop in H as [H H3].
  apply andb_prop in H as [H1 H2]. repeat split; [|apply Qpos; assumption|apply Rmult_lt_0_compat; apply Qpos; assumption].
  unfold deadline. destruct (kind c); [apply Qpos; assumption|].
  repeat (apply andb_prop in H4 as [H4 ?]). apply Rplus_lt_0_compat; apply Qpos; assumption.
Qed.
Lemma power_below y m : 0 < y <= 1 -> 1 <= m -> Rpower y m <= y.
Proof.
  intros [Y0 Y1] Hm. rewrite <- (exp_ln y) at 2 by exact Y0. unfold Rpower.
  assert (L : ln y <= 0) by (destruct Y1 as [Y1| ->]; [left; rewrite <- ln_1; apply ln_increasing; assumption|rewrite ln_1; lra]).
  destruct (Req_dec (m * ln y) (ln y)) as [->|N]; [lra|]. left. apply exp_increasing. nra.
Qed.

Section Slide.
Variables (c : cert) (T_r T_s mu1 mu2 mu3 delta : Q).
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hkind : kind c = SlidingMode T_r T_s mu1 mu2 mu3 delta.
Let Tr := Q2R T_r.
Let m := Q2R mu3 * Q2R (kappa c).
Let w := psi c T_r mu2 mu3.
Let p := pull c T_r mu2 mu3.
Lemma parts : 0 < Tr < deadline c /\ 0 < Q2R mu1 - Q2R delta /\ 0 < Q2R mu2 /\ 0 < m.
Proof.
  unfold check_protocol in Hprot. rewrite Hkind in Hprot. apply andb_prop in Hprot as [H H4].
  apply andb_prop in H as [_ Hk]. apply andb_prop in H4 as [H4 Hd]. apply andb_prop in H4 as [H4 _].
  apply andb_prop in H4 as [H4 H5]. apply andb_prop in H4 as [H4 H6]. apply andb_prop in H4 as [H4 _].
  apply andb_prop in H4 as [H1 H2]. apply Qpos in Hk, H1, H2, H5, H6. unfold deadline. rewrite Hkind. fold Tr in H1.
  split; [fold Tr; lra|]. split; [|split; [exact H6|apply Rmult_lt_0_compat; assumption]].
  apply negb_true_iff in Hd. destruct (Qlt_le_dec delta mu1) as [L|L]; [apply Qlt_Rlt in L; lra|].
  apply Qle_bool_iff in L. congruence.
Qed.
Lemma delta_pos : 0 <= Q2R delta.
Proof.
  assert (H := Hprot). unfold check_protocol in H. rewrite Hkind in H. apply andb_prop in H as [_ H].
  apply andb_prop in H as [H _]. apply andb_prop in H as [_ H]. apply Z.leb_le in H. unfold Q2R.
  apply Rmult_le_pos; [apply IZR_le; exact H|]. left. apply Rinv_0_lt_compat. apply IZR_lt. reflexivity.
Qed.
Lemma pull_pos t : 0 < p t.
Proof.
  destruct parts as [A [_ [B C]]]. unfold p, pull. fold Tr m. destruct (Rlt_dec t Tr) as [L|L]; [|lra].
  assert (0 < m / (Tr - t)) by (apply Rdiv_lt_0_compat; lra). lra.
Qed.
Lemma psi_derive t : t < Tr -> is_derive w t (- (p t * w t)).
Proof.
  intros H. destruct parts as [A _]. unfold w, p, psi, pull. fold Tr m. destruct (Rlt_dec t Tr) as [_|N]; [|contradiction].
  unfold Rpower. auto_derive.
  - apply Rmult_lt_0_compat; [lra|apply Rinv_0_lt_compat; lra].
  - change ((Tr - t) / Tr) with ((Tr + - t) * / Tr). generalize (exp (m * ln ((Tr + - t) * / Tr))). intros E. field. lra.
Qed.
Lemma psi_pos t : 0 < w t.
Proof. unfold w, psi, Rpower. apply Rmult_lt_0_compat; apply exp_pos. Qed.
Lemma psi_0 : w 0 = 1.
Proof.
  destruct parts as [A _]. unfold w, psi. fold Tr m. replace ((Tr - 0) / Tr) with 1 by (field; lra).
  unfold Rpower. rewrite ln_1, !Rmult_0_r, Ropp_0, exp_0. ring.
Qed.
Lemma psi_power t : 0 <= t -> w t <= Rpower ((Tr - t) / Tr) m.
Proof.
  intros H. destruct parts as [_ [_ [B _]]]. unfold w, psi. fold Tr m. rewrite <- (Rmult_1_l (Rpower _ m)) at 2.
  apply Rmult_le_compat_r; [left; apply exp_pos|]. rewrite <- exp_0.
  destruct (Req_dec (Q2R mu2 * t) 0) as [->|N]; [rewrite Ropp_0; lra|]. left. apply exp_increasing. nra.
Qed.

Section Agent.
Variables (X S : R -> nat -> R) (i : nat).
Hypothesis HM : moves c X S.
Hypothesis Hi : (i < order c)%nat.
Lemma laws t e : 0 <= t < deadline c -> S t i <> 0 -> 0 < e -> exists eta, 0 < eta /\ forall h, 0 < h < eta ->
  Rabs (Rabs (S (t + h) i) - (Rabs (S t i) - h * (Q2R mu1 + p t * Rabs (S t i)))) <= h * (Q2R delta + e).
Proof. intros Ht N He. destruct HM as [_ H]. unfold slides in H. rewrite Hkind in H. exact (H t i e Ht Hi N He). Qed.
Lemma law t e : 0 <= t < deadline c -> S t i <> 0 -> 0 < e -> exists eta, 0 < eta /\ forall h, 0 < h < eta ->
  Rabs (S (t + h) i) <= Rabs (S t i) - h * (Q2R mu1 - Q2R delta + p t * Rabs (S t i) - e).
Proof.
  intros Ht N He. destruct (laws t e Ht N He) as [eta [E H]]. exists eta. split; [exact E|]. intros h Hh. specialize (H h Hh).
  apply Rabs_le_between in H. lra.
Qed.
Lemma size_cont t : t < deadline c -> continuous (fun u => Rabs (S (Rmax 0 u) i)) t.
Proof.
  intros Ht. destruct HM as [[_ C] _]. apply (continuous_comp (fun u => S (Rmax 0 u) i) Rabs); [|apply continuous_Rabs].
  apply C; assumption.
Qed.
(** below what falls slower than the law wherever both are equal, by a margin *)
Lemma slower e a b (f df : R -> R) : 0 <= a <= b -> b < deadline c -> 0 < e -> (forall t, a <= t <= b -> is_derive f t (df t)) ->
  (forall t, a <= t < b -> Rabs (S t i) = f t -> S t i <> 0 /\ 2 * e <= df t + (Q2R mu1 - Q2R delta) + p t * f t) ->
  Rabs (S a i) <= f a -> Rabs (S b i) <= f b.
Proof.
  intros [A0 Ab] Bd He D H Ha.
  assert (K : 0 <= f b - Rabs (S (Rmax 0 b) i)); [|rewrite Rmax_right in K by lra; lra].
  apply (stays a b (fun u => f u - Rabs (S (Rmax 0 u) i)) Ab).
  - intros t Ht. apply (continuous_minus f (fun u => Rabs (S (Rmax 0 u) i))); [|apply size_cont; lra].
    apply @ex_derive_continuous. exists (df t). apply D. exact Ht.
  - rewrite Rmax_right by lra. lra.
  - intros t Ht Z. rewrite Rmax_right in Z by lra. assert (Q : Rabs (S t i) = f t) by lra. destruct (H t Ht Q) as [N M].
    destruct (law t e ltac:(lra) N He) as [e1 [E1 L1]]. rewrite Q in L1.
    pose proof (D t ltac:(lra)) as Dt. apply is_derive_Reals in Dt. destruct (Dt e He) as [e2 L2].
    exists (Rmin e1 e2). split; [apply Rmin_pos; [exact E1|apply cond_pos]|]. intros h Hh.
    pose proof (Rmin_l e1 e2). pose proof (Rmin_r e1 e2). specialize (L1 h ltac:(lra)).
    specialize (L2 h ltac:(lra) ltac:(rewrite Rabs_right; lra)). apply Rabs_def2 in L2 as [_ L2].
    rewrite Rmax_right by lra. apply (Rmult_lt_compat_l h) in L2; [|lra].
    replace (h * ((f (t + h) - f t) / h - df t)) with (f (t + h) - f t - h * df t) in L2 by (field; lra).
    apply (Rmult_le_compat_l h) in M; lra.
Qed.
(** below what falls no faster than the pull *)
Lemma held a b (f df : R -> R) : 0 <= a <= b -> b < deadline c ->
  (forall t, a <= t <= b -> is_derive f t (df t) /\ 0 < f t /\ - (p t * f t) <= df t) ->
  Rabs (S a i) <= f a -> Rabs (S b i) <= f b.
Proof.
  intros Hab Bd H. destruct parts as [_ [M _]]. apply (slower ((Q2R mu1 - Q2R delta) / 2) a b f df Hab Bd); [lra|intros t Ht; apply H; exact Ht|].
  intros t Ht Q. destruct (H t ltac:(lra)) as [_ [P G]]. split; [intros E; rewrite E, Rabs_R0 in Q; lra|lra].
Qed.
Lemma shrinks t : 0 <= t < Tr -> Rabs (S t i) <= w t * Rabs (S 0 i).
Proof.
  intros Ht. destruct parts as [A _]. apply le_epsilon. intros e He. pose proof (psi_pos t) as P.
  set (q := Rabs (S 0 i) + e / w t). assert (Q0 : 0 < e / w t) by (apply Rdiv_lt_0_compat; assumption).
  pose proof (Rabs_pos (S 0 i)) as S0.
  replace (w t * Rabs (S 0 i) + e) with (q * w t) by (unfold q; field; lra).
  apply (held 0 t (fun u => q * w u) (fun u => q * - (p u * w u))); [lra|lra| |rewrite psi_0; unfold q; lra].
  intros u Hu. split; [apply is_derive_scal; apply psi_derive; lra|]. pose proof (psi_pos u).
  assert (0 < q) by (unfold q; lra). split; [apply Rmult_lt_0_compat; assumption|]. right. ring.
Qed.
Lemma reached : S Tr i = 0.
Proof.
  destruct parts as [A [_ [_ Pm]]]. destruct (Req_dec (S Tr i) 0) as [E|N]; [exact E|]. exfalso.
  pose proof (Rabs_pos_lt _ N) as P. set (e := Rabs (S Tr i)) in *. pose proof (Rabs_pos (S 0 i)) as S0.
  assert (He : 0 < e / 2) by lra. assert (Cs := size_cont Tr (proj2 A)).
  destruct (proj1 (filterlim_locally _ _) Cs (mkposreal (e / 2) He)) as [r Hr].
  set (q := e / 2 / (Rabs (S 0 i) + 1)). assert (Q0 : 0 < q) by (unfold q; repeat apply Rdiv_lt_0_compat; lra).
  set (y := Rmin (1 / 2) (Rmin (r / 2 / Tr) (exp (ln q / m)))). pose proof (cond_pos r) as R0.
  assert (Y0 : 0 < y).
  { unfold y. apply Rmin_pos; [lra|]. apply Rmin_pos; [|apply exp_pos]. apply Rdiv_lt_0_compat; [apply Rdiv_lt_0_compat; lra|lra]. }
  assert (Y1 : y <= 1 / 2) by apply Rmin_l.
  assert (Y2 : y <= r / 2 / Tr) by (eapply Rle_trans; [apply Rmin_r|apply Rmin_l]).
  assert (Y3 : y <= exp (ln q / m)) by (eapply Rle_trans; [apply Rmin_r|apply Rmin_r]).
  assert (Y4 : y * Tr <= r / 2).
  { apply (Rmult_le_compat_r Tr) in Y2; [|lra]. replace (r / 2 / Tr * Tr) with (r / 2) in Y2 by (field; lra). exact Y2. }
  set (t := Tr - y * Tr). assert (Ht : 0 <= t < Tr) by (unfold t; nra).
  assert (B : Rabs (Rabs (S t i) - e) < e / 2).
  { specialize (Hr t). rewrite (Rmax_right 0 Tr) in Hr by lra. rewrite Rmax_right in Hr by lra. apply Hr.
    change (Rabs (t - Tr) < r). apply Rabs_def1; unfold t; nra. }
  apply Rabs_def2 in B. pose proof (shrinks t Ht) as K. pose proof (psi_power t ltac:(lra)) as W.
  replace ((Tr - t) / Tr) with y in W by (unfold t; field; lra).
  assert (W2 : Rpower y m <= q).
  { unfold Rpower. rewrite <- (exp_ln q) by exact Q0.
    assert (L : ln y <= ln q / m).
    { rewrite <- (ln_exp (ln q / m)). destruct Y3 as [Y3|Y3]; [left; apply ln_increasing; assumption|right; f_equal; exact Y3]. }
    assert (L2 : m * ln y <= ln q).
    { apply (Rmult_le_compat_l m) in L; [|lra]. replace (m * (ln q / m)) with (ln q) in L by (field; lra). exact L. }
    destruct L2 as [L2|L2]; [left; apply exp_increasing; exact L2|rewrite L2; lra]. }
  assert (W3 : q * (Rabs (S 0 i) + 1) = e / 2) by (unfold q; field; lra).
  assert (w t * Rabs (S 0 i) <= q * Rabs (S 0 i)) by (apply Rmult_le_compat_r; lra). nra.
Qed.
Lemma rests t : Tr <= t < deadline c -> S t i = 0.
Proof.
  intros Ht. destruct parts as [A _]. destruct (Req_dec (S t i) 0) as [E|N]; [exact E|]. exfalso.
  pose proof (Rabs_pos_lt _ N) as P. set (e := Rabs (S t i)) in *.
  assert (K : Rabs (S t i) <= e / 2); [|fold e in K; lra].
  apply (held Tr t (fun _ => e / 2) (fun _ => 0)); [lra|lra| |rewrite reached, Rabs_R0; lra].
  intros u _. split; [apply @is_derive_const|]. split; [lra|]. pose proof (pull_pos u). nra.
Qed.
Lemma pulled_below t : 1 <= m \/ S 0 i = 0 -> 0 <= t < Tr -> p t * Rabs (S t i) <= (Q2R mu2 + m / Tr) * Rabs (S 0 i).
Proof.
  intros H1 Ht. destruct parts as [A [_ [Pn Pm]]].
  pose proof (shrinks t Ht) as K. pose proof (Rabs_pos (S 0 i)) as S0. pose proof (pull_pos t) as P.
  destruct H1 as [H1|H1].
  - set (y := (Tr - t) / Tr). assert (Y : 0 < y <= 1).
    { split; [apply Rdiv_lt_0_compat; lra|]. apply (Rmult_le_reg_r Tr); [lra|]. unfold y, Rdiv. rewrite Rmult_assoc, Rinv_l; lra. }
    pose proof (psi_power t ltac:(lra)) as W. fold y in W. pose proof (power_below y m Y H1) as W2.
    assert (K2 : p t * Rabs (S t i) <= p t * (y * Rabs (S 0 i))).
    { apply Rmult_le_compat_l; [lra|]. eapply Rle_trans; [exact K|]. apply Rmult_le_compat_r; lra. }
    eapply Rle_trans; [exact K2|]. rewrite <- Rmult_assoc. apply Rmult_le_compat_r; [exact S0|].
    unfold p, pull. fold Tr m. destruct (Rlt_dec t Tr) as [_|N]; [|lra].
    replace ((Q2R mu2 + m / (Tr - t)) * y) with (Q2R mu2 * y + m * / Tr) by (unfold y; field; lra). nra.
  - rewrite H1, Rabs_R0, Rmult_0_r in K |- *. nra.
Qed.
Definition own_part q : Q := (mu1 + (mu2 + mu3 * kappa c / T_r) * Qabs q)%Q.
Lemma own_part_ok : S 0 i = Q2R (nth i (sliding c) 0%Q) ->
  Q2R (own_part (nth i (sliding c) 0%Q)) = Q2R mu1 + (Q2R mu2 + m / Tr) * Rabs (S 0 i).
Proof.
  intros H0. destruct parts as [A _]. unfold own_part.
  assert (Z : ~ (T_r == 0)%Q) by (intros Z; apply Qeq_eqR in Z; fold Tr in Z; unfold Q2R in Z at 1; simpl in Z; lra).
  rewrite Q2R_plus, Q2R_mult, Q2R_plus. unfold Qdiv. rewrite !Q2R_mult, Q2R_inv by exact Z. fold Tr m.
  replace (Q2R (Qabs (nth i (sliding c) 0%Q))) with (Rabs (S 0 i)); [reflexivity|].
  rewrite H0. destruct (nth i (sliding c) 0%Q) as [x d]. unfold Q2R. simpl. rewrite abs_IZR, Rabs_mult. f_equal.
  apply Rabs_right. apply Rle_ge. left. apply Rinv_0_lt_compat. apply IZR_lt. reflexivity.
Qed.
Lemma added_below t : 1 <= m \/ S 0 i = 0 -> 0 <= t < deadline c -> S 0 i = Q2R (nth i (sliding c) 0%Q) ->
  added c S t i <= Q2R (own_part (nth i (sliding c) 0%Q)).
Proof.
  intros H1 Ht H0. rewrite (own_part_ok H0). unfold added. rewrite Hkind. fold p. apply Rplus_le_compat_l.
  destruct (Rlt_le_dec t Tr) as [L|L]; [apply pulled_below; [exact H1|lra]|]. rewrite (rests t) by lra. rewrite Rabs_R0, Rmult_0_r.
  destruct parts as [A [_ [Pn Pm]]]. apply Rmult_le_pos; [|apply Rabs_pos]. assert (0 < m / Tr) by (apply Rdiv_lt_0_compat; lra). lra.
Qed.
Lemma input_part t l : check_sliding_input c = true -> sliding_input c = l -> 0 <= t < Tr -> (i < length l)%nat ->
  S 0 i = Q2R (nth i (sliding c) 0%Q) -> added c S t i <= Q2R (nth i l 0%Q).
Proof.
  intros H E Ht Hl H0. destruct parts as [A _]. unfold check_sliding_input in H. rewrite Hkind, E in H.
  destruct l as [|a l']; [simpl in Hl; lia|]. set (l := a :: l') in *. apply andb_prop in H as [H1 H2].
  rewrite forallb_forall in H2. specialize (H2 i ltac:(apply in_seq; lia)). apply Qle_bool_iff, Qle_Rle in H2.
  eapply Rle_trans; [|exact H2]. apply added_below; [|lra|exact H0]. apply orb_prop in H1 as [H1|H1].
  - left. apply Qle_bool_iff, Qle_Rle in H1. rewrite Q2R_mult in H1. fold m in H1.
    replace (Q2R 1) with 1 in H1 by (unfold Q2R; simpl; lra). exact H1.
  - right. rewrite H0. rewrite forallb_forall in H1. destruct (nth_in_or_default i (sliding c) 0%Q) as [I|I].
    + specialize (H1 _ I). apply Qeq_bool_eq, Qeq_eqR in H1. rewrite H1. unfold Q2R. simpl. ring.
    + rewrite I. unfold Q2R. simpl. ring.
Qed.

End Agent.
End Slide.

(** every motion has an instant from which all sliding variables are 0 *)
Theorem settles c : check_protocol c = true -> forall X S, moves c X S -> exists t0, moves_from c X S t0.
Proof.
  intros HP X S HM. destruct (kind c) as [T|T_r T_s mu1 mu2 mu3 delta] eqn:K.
  - exists 0. split; [exact HM|]. destruct HM as [_ HS]. unfold slides in HS. rewrite K in HS. split; [|intros; apply HS].
    unfold check_protocol in HP. rewrite K in HP. apply andb_prop in HP as [_ HP]. apply Qpos in HP. unfold deadline. rewrite K. lra.
  - exists (Q2R T_r). split; [exact HM|]. destruct (parts c _ _ _ _ _ _ HP K) as [A _]. split; [lra|].
    intros t i Ht Hi. apply (rests c _ _ _ _ _ _ HP K X S i HM Hi t Ht).
Qed.
