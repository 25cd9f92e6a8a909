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
Lemma end_ext x z j : (forall i, (i < N)%nat -> x i = z i) -> end_state c x j = end_state c z j.
Proof.
  intros H. destruct (end_parts c Hend) as [_ [_ [_ [L _]]]]. fold c N in L. unfold end_state.
  induction (balanced_comps (comps c)) as [|b l IH]; simpl; [reflexivity|]. rewrite IH by (intros; apply L; right; assumption). f_equal. f_equal.
  apply qdot_ext. intros i Hi. apply H. destruct (L b ltac:(left; reflexivity)) as [_ [_ K]]. unfold N. lia.
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

(** * The common motion of agents without feedback of their own, that of one agent without neighbours *)
Hypothesis Hdamp : forall l, at_ (damping a) l = 0.
Let w (j i : nat) (t : R) := end_state c (placed h (X (Rmax 0 t)) i) j.
Lemma w_continuous j i t : 0 <= t < T -> (i < n)%nat -> continuous (w j i) t.
Proof.
  intros Ht Hi. apply (end_continuous (fun u => placed h (X (Rmax 0 u)) i)). intros l Hl. unfold placed.
  apply (continuous_minus (fun u => X (Rmax 0 u) i l) (fun _ => if (i =? 0)%nat then h l else 0)); [|apply continuous_const].
  apply HX; [exact Hl|apply Ht|exact Hi].
Qed.
Lemma w_derive j i t : 0 < t < T -> (i < n)%nat -> is_derive (w j i) t (if (S i =? n)%nat then - sum n (fun l => at_ (plant a) l * w j l t) else w j (S i) t).
Proof.
  intros Ht Hi. evar_last.
  - apply (end_derive (fun u => placed h (X (Rmax 0 u)) i)
      (fun l => if (S i =? n)%nat then control a h (X t) t l - sum n (fun v => at_ (plant a) v * X t v l) else X t (S i) l)).
    intros l Hl. unfold placed. evar_last.
    + apply (is_derive_minus (fun u => X (Rmax 0 u) i l) (fun _ => if (i =? 0)%nat then h l else 0)); [|apply @is_derive_const].
      apply (X_derive a h X Sl Hprot Hn HX t i l Ht Hi Hl).
    + exact (Rminus_0_r _).
  - unfold w. rewrite Rmax_right by lra. destruct (Nat.eqb_spec (S i) n) as [E|E].
    + set (x := comb n (fun l => eta a t ^ n * at_ (gains a) l) (fun l => lap (edges c) (y a h (X t) t l))).
      set (z := comb n (at_ (plant a)) (placed h (X t))). transitivity (end_state c (fun l => -1 * x l + -1 * z l) j).
      * f_equal. apply functional_extensionality. intros l. unfold n, c. rewrite (placed_sum a h Hn (X t)). unfold control, x, z, comb. fold n c.
        rewrite (sum_ext n (fun v => eta a t ^ n * at_ (gains a) v * _) (fun v => eta a t ^ n * (at_ (gains a) v * lap (edges c) (y a h (X t) t v) l)))
          by (intros; ring). rewrite sum_scal.
        rewrite (sum_ext n (fun v => _ + at_ (damping a) v * _) (fun v => at_ (gains a) v * lap (edges c) (y a h (X t) t v) l))
          by (intros; rewrite Hdamp; ring). ring.
      * rewrite (end_plus (fun l => -1 * x l)), !end_scal. unfold x, z. rewrite !end_comb, (sum_zero n (fun l => _ * end_state c (lap _ _) j)); [ring|].
        intros l _. rewrite end_lap. ring.
    + f_equal. apply functional_extensionality. intros l. unfold placed. simpl. ring.
Qed.
(** chains of integrators *)
Hypothesis Hplant : forall l, at_ (plant a) l = 0.
Theorem drifts j : forall m i, (i + m = n)%nat -> (0 < m)%nat -> forall t, 0 <= t < T -> w j i t = taylor m (fun l => w j (i + l) 0) t.
Proof.
  induction m as [|m IH]; intros i Hi Hm t Ht; [lia|].
  assert (E : w j i t - taylor (S m) (fun l => w j (i + l) 0) t = w j i 0 - taylor (S m) (fun l => w j (i + l) 0) 0).
  { apply (still T (fun t => w j i t - taylor (S m) (fun l => w j (i + l) 0) t)); [| |exact Ht].
    - intros u Hu. evar_last.
      + apply (is_derive_minus (w j i) (taylor (S m) (fun l => w j (i + l) 0))); [apply w_derive; [exact Hu|lia]|apply taylor_derive].
      + change ((if (S i =? n)%nat then - sum n (fun l => at_ (plant a) l * w j l u) else w j (S i) u) - taylor m (fun l => w j (i + S l) 0) u = 0).
        destruct (Nat.eqb_spec (S i) n) as [E|E].
        * replace m with 0%nat by lia. rewrite (sum_zero n) by (intros; rewrite Hplant; ring). unfold taylor, sum. simpl. ring.
        * rewrite (IH (S i)) by (try lia; lra). unfold taylor.
          rewrite (sum_ext m (fun l => u ^ l / INR (fact l) * w j (i + S l) 0) (fun l => u ^ l / INR (fact l) * w j (S i + l) 0))
            by (intros l _; replace (i + S l)%nat with (S i + l)%nat by lia; reflexivity). ring.
    - intros u Hu. apply (continuous_minus (w j i) (taylor (S m) (fun l => w j (i + l) 0))); [apply w_continuous; [exact Hu|lia]|].
      apply @ex_derive_continuous. eexists. apply taylor_derive. }
  rewrite taylor_zero, Nat.add_0_r in E. lra.
Qed.
End End.

(** * What a power of the gain leaves of the decay, and how far the clock goes *)
Section Powers.
Variable a : agents.
Let c := graph a.
Let T := deadline c.
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hgain : positive_gain a.
Lemma powers m q : INR m <= q * k c -> forall t, 0 <= t < T -> exp (- (q * turns a t)) * eta a t ^ m <= eta a 0 ^ m.
Proof.
  intros Hq t Ht. destruct (T_k a Hprot) as [A B]. fold c T in A, B.
  assert (q0 : 0 <= q) by (pose proof (pos_INR m); nra).
  assert (D : exp (- (q * turns a t)) * eta a t ^ m <= exp (- (q * turns a 0)) * eta a 0 ^ m).
  { assert (DE : forall t, t < T -> is_derive (fun t => exp (- (q * turns a t))) t (- (q * eta a t) * exp (- (q * turns a t)))).
    { clear t Ht. intros t Ht. evar_last. { apply is_derive_comp; [apply is_derive_exp|]. apply @is_derive_opp. apply is_derive_scal.
      apply (turns_derive a Hprot). exact Ht. } unfold scal, opp; simpl; unfold mult; simpl. ring. }
    apply (FamilyFlow.falls (fun t => exp (- (q * turns a t)) * eta a t ^ m) 0 T (fun _ => corner a)); [| |exact Ht]; clear t Ht; intros t Ht.
    - apply (continuous_mult (fun t => exp (- (q * turns a t))) (fun t => eta a t ^ m)).
      + apply @ex_derive_continuous. eexists. apply DE. apply Ht.
      + apply continuous_power, (eta_continuous a). apply Ht.
    - intros Hc. destruct (eta_derive a Hprot Hgain t (proj2 Ht) (Hc O)) as [d [Dd [d0 dk]]]. fold c in dk.
      exists (- (q * eta a t) * exp (- (q * turns a t)) * eta a t ^ m + exp (- (q * turns a t)) * (INR m * d * eta a t ^ pred m)). split.
      + apply (is_derive_mult (fun t => exp (- (q * turns a t))) (fun t => eta a t ^ m)); [apply DE, Ht|apply (is_derive_pow (eta a) m); exact Dd|].
        intros; apply Rmult_comm.
      + pose proof (exp_pos (- (q * turns a t))) as E. pose proof (eta_pos a Hprot Hgain t (proj2 Ht)) as P.
        destruct m as [|m].
        * simpl. set (x := exp (- (q * turns a t))) in *. set (e := eta a t) in *. assert (0 <= q * e) by nra. assert (0 <= q * e * x) by nra. lra.
        * simpl pred. rewrite <- tech_pow_Rmult. pose proof (pow_lt (eta a t) m P) as P'.
          assert (K : INR (S m) * d <= q * sq (eta a t)).
          { apply (Rle_trans _ (q * (k c * d))); [|apply Rmult_le_compat_l; assumption]. rewrite <- Rmult_assoc. apply Rmult_le_compat_r; assumption. }
          unfold sq in K. set (e := eta a t) in *. set (x := exp (- (q * turns a t))) in *.
          replace (- (q * e) * x * (e * e ^ m) + x * (INR (S m) * d * e ^ m)) with (x * e ^ m * (INR (S m) * d - q * (e * e))) by ring.
          assert (0 <= x * e ^ m) by nra. nra. }
  rewrite (turns_0 a), Rmult_0_r, Ropp_0, exp_0, Rmult_1_l in D. exact D.
Qed.
Lemma eta_integrable u v : u < T -> v < T -> ex_RInt (eta a) u v.
Proof.
  intros Hu Hv. apply (ex_RInt_continuous (eta a)). intros z [_ Hz]. apply eta_continuous.
  eapply Rle_lt_trans; [exact Hz|]. apply Rmax_lub_lt; assumption.
Qed.
Lemma turns_pos t : 0 <= t < T -> 0 <= turns a t.
Proof.
  intros Ht. apply RInt_ge_0; [lra|apply eta_integrable; lra|]. intros u Hu. left. apply (eta_pos a Hprot Hgain). fold c T. lra.
Qed.
(** the gain is at most its cap, and so is what a decay leaves of its powers *)
Lemma capped G m q : cap a = Some G -> 0 <= q -> forall t, 0 <= t < T -> exp (- (q * turns a t)) * eta a t ^ m <= Q2R G ^ m.
Proof.
  intros EG q0 t Ht. pose proof (turns_pos t Ht) as P. pose proof (eta_pos a Hprot Hgain t (proj2 Ht)) as E.
  assert (B : eta a t <= Q2R G) by (unfold eta; rewrite EG; apply Rmin_r).
  assert (X : exp (- (q * turns a t)) <= 1).
  { rewrite <- exp_0. destruct (Req_dec (q * turns a t) 0) as [Z|Z]; [rewrite Z, Ropp_0; lra|]. left. apply exp_increasing.
    assert (0 <= q * turns a t) by (apply Rmult_le_pos; assumption). lra. }
  rewrite <- (Rmult_1_l (Q2R G ^ m)). apply Rmult_le_compat; [left; apply exp_pos|apply pow_le; lra|exact X|apply pow_incr; lra].
Qed.
Lemma uncapped_clock t : 0 <= t < T -> RInt (uncapped a) 0 t = clock T (Q2R (slope a)) (k c) t.
Proof.
  intros Ht. destruct (T_k a Hprot) as [A B]. fold c T in A, B. apply is_RInt_unique.
  replace (clock T (Q2R (slope a)) (k c) t) with (minus (clock T (Q2R (slope a)) (k c) t) (clock T (Q2R (slope a)) (k c) 0)).
  - apply (is_RInt_derive (clock T (Q2R (slope a)) (k c)) (uncapped a)); rewrite Rmin_left, Rmax_right by lra; intros u Hu.
    + unfold clock, uncapped, gain. fold c T. auto_derive.
      * split; [lra|]. split; [|exact I]. apply Rdiv_lt_0_compat; lra.
      * field. lra.
    + apply (uncapped_continuous a). fold c T. lra.
  - unfold minus, plus, opp, clock; simpl. rewrite Rminus_0_r. replace (T / T) with 1 by (field; lra). rewrite ln_1. ring.
Qed.
Lemma turns_clock t : cap a = None -> 0 <= t < T -> turns a t = clock T (Q2R (slope a)) (k c) t.
Proof. intros E Ht. rewrite <- uncapped_clock by exact Ht. unfold turns, eta, uncapped. rewrite E. reflexivity. Qed.
(** where the gain reaches its cap at [t1] *)
Lemma turns_late G t1 t : cap a = Some G -> 0 <= t1 <= t -> t < T -> (forall u, 0 <= u < t1 -> uncapped a u <= Q2R G) ->
  (forall u, t1 < u < T -> Q2R G <= uncapped a u) -> turns a t = clock T (Q2R (slope a)) (k c) t1 + Q2R G * (t - t1).
Proof.
  intros EG H1 Ht Below Above. unfold turns. rewrite <- (RInt_Chasles (eta a) 0 t1 t) by (apply eta_integrable; lra).
  rewrite <- uncapped_clock by lra. change (plus ?u ?v) with (u + v). f_equal.
  - apply RInt_ext. rewrite Rmin_left, Rmax_right by lra. intros u Hu. unfold eta. rewrite EG. apply Rmin_left. apply Below. lra.
  - rewrite (RInt_ext (eta a) (fun _ => Q2R G)).
    + rewrite RInt_const. unfold scal; simpl; unfold mult; simpl. ring.
    + rewrite Rmin_left, Rmax_right by lra. intros u Hu. unfold eta. rewrite EG. apply Rmin_right. apply Above. lra.
Qed.
(** what falls as the derivative [i] of a deviation does vanishes at the deadline *)
Lemma vanishes (z : R -> R) i r C : cap a = None -> 0 <= C -> 2 * INR i < r * k c ->
  (forall t, 0 <= t < T -> sq (z t) <= sq (eta a t ^ i) * (C * exp (- (r * turns a t)))) -> filterlim z (at_left T) (locally 0).
Proof.
  intros EC HC Hr Hz. destruct (T_k a Hprot) as [A B]. pose proof (proj1 Hgain) as R0. fold c T in A, B. set (q := 2 * INR i / k c). set (b := r - q).
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
    { rewrite <- exp_plus. assert (M : forall u v, u <= v -> exp u <= exp v) by (intros u v [L| ->]; [left; apply exp_increasing; exact L|right; reflexivity]). apply M. rewrite (turns_clock t EC Ht). unfold clock. fold c T. nra. }
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
