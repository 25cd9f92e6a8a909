(** Where agents of order n end: deviations vanish at the deadline, and the common motion of chains of integrators is that
    of one agent without neighbours. *)
Require Import ZArith QArith Qreals List Bool Reals Factorial Lra Lia Psatz FunctionalExtensionality.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Main AgentCertificate AgentForms AgentFall AgentMotion.
Open Scope R_scope.

(** * Sums from the front, and Taylor's *)
Lemma sum_front n f : sum (S n) f = f 0%nat + sum n (fun i => f (S i)).
Proof.
  unfold sum. cbn [seq fold_right]. f_equal. rewrite <- seq_shift. generalize (seq 0 n) as s.
  induction s as [|i s IH]; simpl; [reflexivity|]. rewrite IH. reflexivity.
Qed.
Lemma sum_from i : forall n g, (i <= n)%nat -> sum n (fun l => if (i <=? l)%nat then g (l - i)%nat l else 0) = sum (n - i) (fun l => g l (i + l)%nat).
Proof.
  induction i as [|i IH]; intros n g H; [rewrite Nat.sub_0_r; apply sum_ext; intros l _; rewrite Nat.sub_0_r; reflexivity|].
  destruct n as [|n]; [lia|]. rewrite sum_front. cbn [Nat.leb]. rewrite Rplus_0_l.
  change (S n - S i)%nat with (n - i)%nat.
  transitivity (sum (n - i) (fun l => g l (S (i + l)))); [|reflexivity].
  pose proof (IH n (fun u v => g u (S v)) ltac:(lia)) as E. cbv beta in E. rewrite <- E. reflexivity.
Qed.
Definition taylor (m : nat) (g : nat -> R) (t : R) : R := sum m (fun l => t ^ l / INR (fact l) * g l).
Lemma taylor_derive m g t : is_derive (taylor (S m) g) t (taylor m (fun l => g (S l)) t).
Proof.
  apply (is_derive_ext (fun u => g 0%nat + sum m (fun l => u ^ (S l) / INR (fact (S l)) * g (S l)))).
  { intros u. unfold taylor. rewrite sum_front. f_equal. simpl. field. }
  evar_last.
  - apply (is_derive_plus (fun _ => g 0%nat)); [apply @is_derive_const|].
    apply (is_derive_sum m (fun u l => u ^ (S l) / INR (fact (S l)) * g (S l)) (fun l => t ^ l / INR (fact l) * g (S l))). intros l _.
    pose proof (INR_fact_neq_0 l) as F0. pose proof (INR_fact_neq_0 (S l)) as F1.
    assert (E : forall u, (g (S l) / INR (fact (S l))) * u ^ (S l) = u ^ (S l) / INR (fact (S l)) * g (S l)) by (intros u; unfold Rdiv; ring).
    apply (is_derive_ext (fun u => (g (S l) / INR (fact (S l))) * u ^ (S l)) _ _ _ E).
    evar_last.
    + apply is_derive_scal. apply (is_derive_pow (fun u => u)). apply @is_derive_id.
    + change (fact (S l)) with (S l * fact l)%nat in *. rewrite mult_INR in *. unfold one; simpl pred. unfold scal; simpl; unfold mult; simpl.
      change (match l with 0%nat => 1 | S _ => INR l + 1 end) with (INR (S l)) in *.
      assert (INR (S l) <> 0) by (apply not_0_INR; lia). field. split; assumption.
  - unfold plus, zero; simpl. unfold taylor. ring.
Qed.
Lemma taylor_zero m g : taylor (S m) g 0 = g 0%nat.
Proof.
  unfold taylor. rewrite sum_front, (sum_zero m); [simpl; field|]. intros i _. simpl. unfold Rdiv. ring.
Qed.
(** constant where the derivative is 0 *)
Lemma still T (g : R -> R) : (forall t, 0 < t < T -> is_derive g t 0) -> (forall t, 0 <= t < T -> continuous g t) ->
  forall t, 0 <= t < T -> g t = g 0.
Proof.
  intros D C t Ht. apply Rle_antisym.
  - apply (decreasing T 0 g (fun _ => 0)); auto. intros; lra.
  - apply Ropp_le_cancel. apply (decreasing T 0 (fun t => - g t) (fun _ => 0)); auto; [| |intros; lra].
    + intros u Hu. evar_last; [apply @is_derive_opp; apply D; exact Hu|]. unfold opp; simpl; ring.
    + intros u Hu. apply @continuous_opp. auto.
Qed.

Section End.
Variables (a : agents) (h : nat -> R) (X : R -> nat -> nat -> R) (Sl : R -> nat -> R).
Let c := graph a.
Let N := order c.
Let n := degree a.
Let T := deadline c.
Let d := prepare c.
Hypothesis Hedges : check_edges c (dls d) = true.
Hypothesis Hend : check_end c d = true.
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hslope : 0 <= Q2R (slope a).
Hypothesis Hn : (0 < n)%nat.
Hypothesis HX : flies a h X Sl.

Lemma end_scal q x i : end_state c (fun j => q * x j) i = q * end_state c x i.
Proof. unfold end_state. induction (balanced_comps (comps c)) as [|b l IH]; simpl; [ring|]. rewrite IH, qdot_scal. ring. Qed.
Lemma end_plus x z i : end_state c (fun j => x j + z j) i = end_state c x i + end_state c z i.
Proof. unfold end_state. induction (balanced_comps (comps c)) as [|b l IH]; simpl; [ring|]. rewrite IH, qdot_plus. ring. Qed.
Lemma end_comb m l Z i : end_state c (comb m l Z) i = sum m (fun u => l u * end_state c (Z u) i).
Proof.
  unfold comb, sum. induction (seq 0 m) as [|u s IH]; cbn [fold_right].
  - transitivity (0 * end_state c (fun _ => 0) i); [|ring]. rewrite <- end_scal. f_equal. apply functional_extensionality. intros. ring.
  - rewrite (end_plus (fun j => l u * Z u j)), (end_scal (l u)), IH. reflexivity.
Qed.
Lemma end_lap x j : end_state c (lap (edges c) x) j = 0.
Proof.
  pose proof (null_ok c Hedges Hend) as H. unfold end_state. induction (balanced_comps (comps c)) as [|b l IH]; simpl; [reflexivity|].
  rewrite IH by (intros; apply H; right; assumption). rewrite (H b) by (left; reflexivity). ring.
Qed.
Lemma is_derive_qdot l : forall (Z : R -> nat -> R) (dZ : nat -> R) t, (forall i, (i < length l)%nat -> is_derive (fun u => Z u i) t (dZ i)) ->
  is_derive (fun u => qdot l (Z u)) t (qdot l dZ).
Proof.
  induction l as [|q l IH]; intros Z dZ t H; simpl; [apply (is_derive_const 0)|].
  apply (is_derive_plus (fun u => Q2R q * Z u 0%nat) (fun u => qdot l (shift (Z u)))).
  - apply (is_derive_scal (fun u => Z u 0%nat)). apply H. simpl. lia.
  - apply (IH (fun u => shift (Z u)) (shift dZ)). intros i Hi. apply (H (S i)). simpl. lia.
Qed.
Lemma continuous_qdot l : forall (Z : R -> nat -> R) t, (forall i, (i < length l)%nat -> continuous (fun u => Z u i) t) ->
  continuous (fun u => qdot l (Z u)) t.
Proof.
  induction l as [|q l IH]; intros Z t H; simpl; [apply continuous_const|].
  apply (continuous_plus (fun u => Q2R q * Z u 0%nat) (fun u => qdot l (shift (Z u)))).
  - apply (continuous_mult (fun _ => Q2R q)); [apply continuous_const|]. apply H. simpl. lia.
  - apply (IH (fun u => shift (Z u))). intros i Hi. apply (H (S i)). simpl. lia.
Qed.
Lemma end_derive (Z : R -> nat -> R) (dZ : nat -> R) t j : (forall i, (i < N)%nat -> is_derive (fun u => Z u i) t (dZ i)) ->
  is_derive (fun u => end_state c (Z u) j) t (end_state c dZ j).
Proof.
  intros H. destruct (end_parts c Hend) as [_ [_ [_ [L _]]]]. fold c N in L. unfold end_state.
  induction (balanced_comps (comps c)) as [|b l IH]; simpl; [apply (is_derive_const 0)|].
  apply (is_derive_plus (fun u => Q2R (nth j (fst (snd b)) 0%Q) * qdot (snd (snd b)) (Z u)) (fun u => fold_right _ 0 l)).
  - apply (is_derive_scal (fun u => qdot (snd (snd b)) (Z u))). apply is_derive_qdot. intros i Hi. apply H.
    destruct (L b ltac:(left; reflexivity)) as [_ [_ K]]. unfold N. lia.
  - apply IH. intros p Hp. apply L. right. exact Hp.
Qed.
Lemma end_continuous (Z : R -> nat -> R) t j : (forall i, (i < N)%nat -> continuous (fun u => Z u i) t) ->
  continuous (fun u => end_state c (Z u) j) t.
Proof.
  intros H. destruct (end_parts c Hend) as [_ [_ [_ [L _]]]]. fold c N in L. unfold end_state.
  induction (balanced_comps (comps c)) as [|b l IH]; simpl; [apply continuous_const|].
  apply (continuous_plus (fun u => Q2R (nth j (fst (snd b)) 0%Q) * qdot (snd (snd b)) (Z u)) (fun u => fold_right _ 0 l)).
  - apply (continuous_mult (fun _ => Q2R (nth j (fst (snd b)) 0%Q))); [apply continuous_const|]. apply continuous_qdot. intros i Hi. apply H.
    destruct (L b ltac:(left; reflexivity)) as [_ [_ K]]. unfold N. lia.
  - apply IH. intros p Hp. apply L. right. exact Hp.
Qed.

(** * The common motion of chains of integrators *)
Hypothesis Hplant : forall l, at_ (plant a) l = 0.
Hypothesis Hdamp : forall l, at_ (damping a) l = 0.
Let w (j i : nat) (t : R) := end_state c (placed h (X (Rmax 0 t)) i) j.
Lemma w_continuous j i t : 0 <= t < T -> (i < n)%nat -> continuous (w j i) t.
Proof.
  intros Ht Hi. apply (end_continuous (fun u => placed h (X (Rmax 0 u)) i)). intros l Hl. unfold placed.
  apply (continuous_minus (fun u => X (Rmax 0 u) i l) (fun _ => if (i =? 0)%nat then h l else 0)); [|apply continuous_const].
  apply HX; [exact Hl|apply Ht|exact Hi].
Qed.
Lemma w_derive j i t : 0 < t < T -> (i < n)%nat -> is_derive (w j i) t (if (S i =? n)%nat then 0 else w j (S i) t).
Proof.
  intros Ht Hi. evar_last.
  - apply (end_derive (fun u => placed h (X (Rmax 0 u)) i)
      (fun l => if (S i =? n)%nat then control a h (X t) t l - sum n (fun v => at_ (plant a) v * X t v l) else X t (S i) l)).
    intros l Hl. unfold placed. evar_last.
    + apply (is_derive_minus (fun u => X (Rmax 0 u) i l) (fun _ => if (i =? 0)%nat then h l else 0)); [|apply @is_derive_const].
      apply (X_derive a h X Sl Hprot Hn HX t i l Ht Hi Hl).
    + exact (Rminus_0_r _).
  - unfold w. rewrite Rmax_right by lra. destruct (Nat.eqb_spec (S i) n) as [E|E].
    + transitivity (end_state c (comb n (fun l => - (eta a t ^ n * at_ (gains a) l)) (fun l => lap (edges c) (y a h (X t) t l))) j).
      * f_equal. apply functional_extensionality. intros l. unfold control, comb. rewrite Hplant.
        rewrite (sum_zero n (fun v => at_ (plant a) v * X t v l)) by (intros; rewrite Hplant; ring). fold n.
        transitivity (- eta a t ^ n * sum n (fun i0 => at_ (gains a) i0 * lap (edges (graph a)) (y a h (X t) t i0) l + at_ (damping a) i0 * y a h (X t) t i0 l)); [ring|].
        rewrite <- sum_scal. apply sum_ext. intros v _. rewrite Hdamp. fold c. ring.
      * rewrite end_comb. apply sum_zero. intros l _. rewrite end_lap. ring.
    + f_equal. apply functional_extensionality. intros l. unfold placed. simpl. ring.
Qed.
Theorem drifts j : forall m i, (i + m = n)%nat -> (0 < m)%nat -> forall t, 0 <= t < T -> w j i t = taylor m (fun l => w j (i + l) 0) t.
Proof.
  induction m as [|m IH]; intros i Hi Hm t Ht; [lia|].
  assert (E : w j i t - taylor (S m) (fun l => w j (i + l) 0) t = w j i 0 - taylor (S m) (fun l => w j (i + l) 0) 0).
  { apply (still T (fun t => w j i t - taylor (S m) (fun l => w j (i + l) 0) t)); [| |exact Ht].
    - intros u Hu. evar_last.
      + apply (is_derive_minus (w j i) (taylor (S m) (fun l => w j (i + l) 0))); [apply w_derive; [exact Hu|lia]|apply taylor_derive].
      + change ((if (S i =? n)%nat then 0 else w j (S i) u) - taylor m (fun l => w j (i + S l) 0) u = 0).
        destruct (Nat.eqb_spec (S i) n) as [E|E].
        * replace m with 0%nat by lia. unfold taylor, sum. simpl. ring.
        * rewrite (IH (S i)) by (try lia; lra). unfold taylor.
          rewrite (sum_ext m (fun l => u ^ l / INR (fact l) * w j (i + S l) 0) (fun l => u ^ l / INR (fact l) * w j (S i + l) 0))
            by (intros l _; replace (i + S l)%nat with (S i + l)%nat by lia; reflexivity). ring.
    - intros u Hu. apply (continuous_minus (w j i) (taylor (S m) (fun l => w j (i + l) 0))); [apply w_continuous; [exact Hu|lia]|].
      apply @ex_derive_continuous. eexists. apply taylor_derive. }
  rewrite taylor_zero, Nat.add_0_r in E. lra.
Qed.
End End.

(** * What a power of the gain leaves of the decay *)
Section Powers.
Variable a : agents.
Let c := graph a.
Let T := deadline c.
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hslope : 0 <= Q2R (slope a).
Lemma eta_derive t : t < T -> is_derive (eta a) t (k c / sq (T - t)).
Proof.
  intros Ht. unfold eta, gain, sq. fold c T. auto_derive; [lra|]. replace (T + - t) with (T - t) by ring. field. lra.
Qed.
Lemma powers m q : INR m <= q * k c -> forall t, 0 <= t < T -> exp (- (q * turns a t)) * eta a t ^ m <= eta a 0 ^ m.
Proof.
  intros Hq t Ht. destruct (T_k a Hprot) as [A B]. fold c T in A, B.
  assert (D : exp (- (q * turns a t)) * eta a t ^ m <= exp (- (q * turns a 0)) * eta a 0 ^ m).
  { apply (decreasing T 0 (fun t => exp (- (q * turns a t)) * eta a t ^ m) (fun t => - (q * eta a t) * exp (- (q * turns a t)) * eta a t ^ m
      + exp (- (q * turns a t)) * (INR m * (k c / sq (T - t)) * eta a t ^ pred m))); [| | |exact Ht]; clear t Ht.
    - intros t Ht. apply (is_derive_mult (fun t => exp (- (q * turns a t))) (fun t => eta a t ^ m)); [| |intros; apply Rmult_comm].
      + evar_last. { apply is_derive_comp; [apply is_derive_exp|]. apply @is_derive_opp. apply is_derive_scal. apply (turns_derive a Hprot). apply Ht. }
        unfold scal, opp; simpl; unfold mult; simpl. ring.
      + apply (is_derive_pow (eta a) m). apply eta_derive. apply Ht.
    - intros t Ht. apply (continuous_mult (fun t => exp (- (q * turns a t))) (fun t => eta a t ^ m)); apply @ex_derive_continuous.
      + eexists. apply is_derive_comp; [apply is_derive_exp|]. apply @is_derive_opp. apply is_derive_scal. apply (turns_derive a Hprot). apply Ht.
      + apply ex_derive_pow. eexists. apply eta_derive. apply Ht.
    - intros t Ht. pose proof (exp_pos (- (q * turns a t))) as E. pose proof (eta_pos a Hprot Hslope t (proj2 Ht)) as P.
      destruct m as [|m].
      + rewrite pow_O. simpl INR in *. assert (q0 : 0 <= q) by nra. set (x := exp (- (q * turns a t))) in *. set (e := eta a t) in *.
        assert (0 <= q * e) by nra. assert (0 <= q * e * x) by nra. simpl pow. lra.
      + simpl pred. rewrite <- tech_pow_Rmult. pose proof (pow_lt (eta a t) m P) as P'.
        assert (K : k c * (k c / sq (T - t)) <= sq (eta a t)).
        { unfold eta, gain. fold c T. replace (k c * (k c / sq (T - t))) with (sq (k c / (T - t))) by (unfold sq; field; lra).
          assert (0 < k c / (T - t)) by (apply Rdiv_lt_0_compat; lra). unfold sq. apply Rmult_le_compat; lra. }
        assert (K2 : INR (S m) * (k c / sq (T - t)) <= q * sq (eta a t)).
        { assert (0 <= INR (S m)) by apply pos_INR. assert (0 < k c / sq (T - t)) by (apply Rdiv_lt_0_compat; [lra|unfold sq; nra]).
          assert (q0 : 0 <= q) by nra. apply (Rle_trans _ (q * k c * (k c / sq (T - t)))); [nra|].
          replace (q * k c * (k c / sq (T - t))) with (q * (k c * (k c / sq (T - t)))) by ring. apply Rmult_le_compat_l; assumption. }
        unfold sq in K2 at 2. set (g := k c / sq (T - t)) in *. set (e := eta a t) in *. set (x := exp (- (q * turns a t))) in *.
        replace (- (q * e) * x * (e * e ^ m) + x * (INR (S m) * g * e ^ m)) with (x * e ^ m * (INR (S m) * g - q * (e * e))) by ring.
        assert (0 <= x * e ^ m) by nra. nra. }
  assert (T0 : turns a 0 = 0).
  { unfold turns, clock. fold c T. rewrite Rminus_0_r. replace (T / T) with 1 by (field; lra). rewrite ln_1. ring. }
  rewrite T0, Rmult_0_r, Ropp_0, exp_0, Rmult_1_l in D. exact D.
Qed.
(** what falls as the derivative [i] of a deviation does vanishes at the deadline *)
Lemma vanishes (z : R -> R) i r C : 0 <= C -> 2 * INR i < r * k c ->
  (forall t, 0 <= t < T -> sq (z t) <= sq (eta a t ^ i) * (C * exp (- (r * turns a t)))) -> filterlim z (at_left T) (locally 0).
Proof.
  intros HC Hr Hz. destruct (T_k a Hprot) as [A B]. fold c T in A, B. set (q := 2 * INR i / k c). set (b := r - q).
  assert (Eq : q * k c = 2 * INR i) by (unfold q; field; lra). assert (Hb : 0 < b) by (unfold b; nra).
  assert (K : quiet 1 T (fun _ _ => 0) 0) by (split; [lra|]; intros; reflexivity).
  apply (reaches 1 T (Q2R (slope a) + 1) (k c) A ltac:(lra) B (fun t _ => z t) (fun _ _ => 0) 0 K 0%nat 0
    (sq (eta a 0 ^ i) * C * exp (b * T)) b Hb).
  - apply Rmult_le_pos; [apply Rmult_le_pos; [apply Rle_0_sqr|exact HC]|left; apply exp_pos].
  - intros t Ht. rewrite Rminus_0_r. fold (sq (z t)). eapply Rle_trans; [apply (Hz t Ht)|].
    pose proof (powers (2 * i) q ltac:(rewrite mult_INR, Eq; simpl; lra) t Ht) as K'.
    assert (P : forall v, v ^ (2 * i) = sq (v ^ i)) by (intros v; unfold sq; rewrite <- pow_add; f_equal; lia).
    rewrite !P in K'.
    assert (E : exp (- (r * turns a t)) = exp (- (q * turns a t)) * exp (- (b * turns a t))) by (rewrite <- exp_plus; f_equal; unfold b; ring).
    rewrite E. assert (E2 : exp (- (b * turns a t)) <= exp (b * T) * exp (- (b * clock T (Q2R (slope a) + 1) (k c) t))).
    { rewrite <- exp_plus. assert (M : forall u v, u <= v -> exp u <= exp v) by (intros u v [L| ->]; [left; apply exp_increasing; exact L|right; reflexivity]). apply M. unfold turns, clock. fold c T. nra. }
    pose proof (exp_pos (- (b * turns a t))). pose proof (Rle_0_sqr (eta a 0 ^ i)) as S0. fold (sq (eta a 0 ^ i)) in S0.
    apply Rle_trans with (sq (eta a 0 ^ i) * C * exp (- (b * turns a t))).
    + replace (sq (eta a t ^ i) * (C * (exp (- (q * turns a t)) * exp (- (b * turns a t)))))
        with (exp (- (q * turns a t)) * sq (eta a t ^ i) * (C * exp (- (b * turns a t)))) by ring.
      replace (sq (eta a 0 ^ i) * C * exp (- (b * turns a t))) with (sq (eta a 0 ^ i) * (C * exp (- (b * turns a t)))) by ring.
      apply Rmult_le_compat_r; [apply Rmult_le_pos; lra|exact K'].
    + replace (sq (eta a 0 ^ i) * C * exp (b * T) * exp (- (b * clock T (Q2R (slope a) + 1) (k c) t)))
        with (sq (eta a 0 ^ i) * C * (exp (b * T) * exp (- (b * clock T (Q2R (slope a) + 1) (k c) t)))) by ring.
      apply Rmult_le_compat_l; [apply Rmult_le_pos; assumption|exact E2].
Qed.
End Powers.
