(** From all initial states agents of order n have a motion: their equation is linear, and its coefficients are continuous. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia FunctionalExtensionality.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Certificate Checker Flow Mean Slide Solution Exist AgentCertificate AgentForms AgentMotion.
Open Scope R_scope.

(** * Functions of all derivatives of all agents that are Lipschitz *)
Definition bounded_by (K : R) (g : (nat * nat -> R) -> R) : Prop :=
  forall x z d, (forall p, Rabs (x p - z p) <= d) -> Rabs (g x - g z) <= K * d.
Lemma bounded_at p : bounded_by 1 (fun x => x p).
Proof. intros x z d H. rewrite Rmult_1_l. apply H. Qed.
Lemma bounded_const q : bounded_by 0 (fun _ => q).
Proof. intros x z d _. rewrite Rminus_eq_0, Rabs_R0. lra. Qed.
Lemma bounded_plus K L g f : bounded_by K g -> bounded_by L f -> bounded_by (K + L) (fun x => g x + f x).
Proof.
  intros A B x z d H. specialize (A x z d H). specialize (B x z d H).
  replace (g x + f x - (g z + f z)) with (g x - g z + (f x - f z)) by ring. eapply Rle_trans; [apply Rabs_triang|]. lra.
Qed.
Lemma bounded_times C K q g : Rabs q <= C -> bounded_by K g -> bounded_by (C * K) (fun x => q * g x).
Proof.
  intros Hq A x z d H. replace (q * g x - q * g z) with (q * (g x - g z)) by ring. rewrite Rabs_mult, Rmult_assoc.
  apply Rmult_le_compat; try apply Rabs_pos; [exact Hq|apply A; exact H].
Qed.
Lemma bounded_le K L g : K <= L -> bounded_by K g -> bounded_by L g.
Proof.
  intros H A x z d D. eapply Rle_trans; [apply A; exact D|]. apply Rmult_le_compat_r; [|exact H].
  eapply Rle_trans; [apply Rabs_pos|apply (D (0, 0)%nat)].
Qed.
Lemma bounded_ext K g f : (forall x, g x = f x) -> bounded_by K g -> bounded_by K f.
Proof. intros E A x z d H. rewrite <- !E. apply A. exact H. Qed.
Lemma bounded_sum n (K : nat -> R) g : (forall i, bounded_by (K i) (g i)) -> bounded_by (sum n K) (fun x => sum n (fun i => g i x)).
Proof.
  intros H. unfold sum. induction (seq 0 n) as [|i l IH]; [apply (bounded_const 0)|].
  apply (bounded_plus (K i) _ (g i) (fun x => fold_right (fun i a => g i x + a) 0 l)); auto.
Qed.

Section Exists.
Variables (a : agents) (h : nat -> R) (begin : nat -> nat -> R).
Let c := graph a.
Let n := degree a.
Let N := order c.
Let T := deadline c.
Hypothesis Hprot : check_protocol c = true.
Hypothesis Hgain : positive_gain a.
Hypothesis Hn : (0 < n)%nat.
Let HT : 0 < T := proj1 (T_pos c Hprot).
Let eta_positive t : t < T -> 0 < eta a t := eta_pos a Hprot Hgain t.
Definition by_agent (x : nat * nat -> R) (i j : nat) := x (i, j).
Definition moved_ t (x : nat * nat -> R) (p : nat * nat) : R := let (i, j) := p in if (S i =? n)%nat
  then control a h (by_agent x) t j - sum n (fun l => at_ (plant a) l * x (l, j)) else x (S i, j).
(** all rest at their offsets: nothing moves *)
Let still_ (p : nat * nat) : R := let (i, j) := p in if (i =? 0)%nat then h j else 0.
Let first (p : nat * nat) : R := let (i, j) := p in if (i <? n)%nat && (j <? N)%nat then begin i j else still_ p.

Lemma moved_bounded v : 0 <= v < T -> exists M, 0 <= M /\ forall t p, 0 <= t <= v -> bounded_by M (fun x => moved_ t x p).
Proof.
  intros Hv. destruct (lap_lipschitz (edges c)) as [K [HK [_ L]]]. pose proof (eta_positive 0 HT) as E0. pose proof (eta_positive v ltac:(lra)) as Ev.
  set (r := fun i => (/ eta a 0) ^ i). assert (R0 : forall i, 0 <= r i) by (intros; apply pow_le; left; apply Rinv_0_lt_compat; exact E0).
  set (row := fun i => Rabs (at_ (gains a) i) * (K * r i) + Rabs (at_ (damping a) i) * r i).
  assert (Row : forall i, 0 <= row i).
  { intros i. unfold row. apply Rplus_le_le_0_compat; repeat apply Rmult_le_pos; auto using Rabs_pos. }
  set (all := eta a v ^ n * sum n row + sum n (fun l => Rabs (at_ (plant a) l))).
  assert (A : 0 <= all).
  { unfold all. apply Rplus_le_le_0_compat; [apply Rmult_le_pos; [apply pow_le; lra|]|];
      rewrite <- (sum_zero n (fun _ => 0)) by reflexivity; apply sum_le; auto using Rabs_pos. }
  exists (1 + all). split; [lra|]. intros t [i j] Ht. cbn [moved_]. destruct (S i =? n)%nat; [|apply (bounded_le 1); [lra|apply bounded_at]].
  assert (Et : 0 < eta a t) by (apply eta_positive; lra).
  assert (Y : forall l q, bounded_by (r l) (fun x => y a h (by_agent x) t l q)).
  { intros l q x z d H. unfold y, placed, by_agent. replace (_ / eta a t ^ l - _ / eta a t ^ l)
      with (/ eta a t ^ l * (x (l, q) - z (l, q))) by (field; apply pow_nonzero; lra).
    rewrite Rabs_mult. apply Rmult_le_compat; try apply Rabs_pos; [|apply H].
    rewrite Rabs_right by (apply Rle_ge; left; apply Rinv_0_lt_compat; apply pow_lt; exact Et). unfold r. rewrite pow_inv.
    apply Rinv_le_contravar; [apply pow_lt; exact E0|]. apply pow_incr. split; [lra|]. apply (eta_grows a Hprot). fold c T. lra. }
  assert (YL : forall l, bounded_by (K * r l) (fun x => lap (edges c) (y a h (by_agent x) t l) j)).
  { intros l x z d H. rewrite Rmult_assoc. apply L. intros q. apply Y. exact H. }
  unfold control. fold n c. apply (bounded_le (0 + (eta a v ^ n * sum n row) + sum n (fun l => Rabs (at_ (plant a) l) * 1))).
  { unfold all. rewrite (sum_ext n (fun l => _ * 1) (fun l => Rabs (at_ (plant a) l))) by (intros; ring). lra. }
  unfold Rminus. apply bounded_plus; [apply bounded_plus; [apply bounded_const|]|].
  - apply (bounded_ext _ (fun x => - eta a t ^ n * sum n (fun i => at_ (gains a) i * lap (edges c) (y a h (by_agent x) t i) j +
      at_ (damping a) i * y a h (by_agent x) t i j))); [intros; ring|]. apply bounded_times.
    + rewrite Rabs_Ropp, Rabs_right by (apply Rle_ge, pow_le; lra). apply pow_incr. split; [lra|]. apply (eta_grows a Hprot). fold c T. lra.
    + apply bounded_sum. intros l. apply bounded_plus; apply bounded_times; auto using Rle_refl.
  - apply (bounded_ext _ (fun x => sum n (fun l => - at_ (plant a) l * x (l, j)))).
    { intros x. rewrite (sum_ext n _ (fun l => -1 * (at_ (plant a) l * x (l, j)))) by (intros; ring). rewrite sum_scal. ring. }
    apply bounded_sum. intros l. apply bounded_times; [rewrite Rabs_Ropp; apply Rle_refl|apply bounded_at].
Qed.
Lemma moved_still t p : moved_ t still_ p = 0.
Proof.
  destruct p as [i j]. cbn [moved_]. destruct (S i =? n)%nat; [|reflexivity].
  assert (Y : forall l q, y a h (by_agent still_) t l q = 0).
  { intros l q. unfold y, placed, by_agent, still_. unfold Rdiv. rewrite Rminus_eq_0. ring. }
  unfold control. rewrite (sum_zero (degree a)).
  2: { intros l _. rewrite Y. destruct (lap_lipschitz (edges (graph a))) as [K [_ [Z _]]].
    rewrite (functional_extensionality (y a h (by_agent still_) t l) (fun _ => 0)) by (intros; apply Y). rewrite Z. ring. }
  rewrite (sum_ext n _ (fun l => if (0 =? l)%nat then at_ (plant a) l * h j else 0)).
  - rewrite sum_at by exact Hn. ring.
  - intros l _. unfold still_. rewrite (Nat.eqb_sym 0 l). destruct (l =? 0)%nat; ring.
Qed.
Lemma moved_continuous x p t : t < T -> continuous (fun u => moved_ u x p) t.
Proof.
  intros Ht. destruct p as [i j]. cbn [moved_]. destruct (S i =? n)%nat; [|apply continuous_const].
  assert (E : continuous (eta a) t) by (apply eta_continuous; exact Ht).
  assert (P : forall m, continuous (fun u => eta a u ^ m) t) by (intros m; apply continuous_power; exact E).
  assert (I : forall m, continuous (fun u => / eta a u ^ m) t).
  { intros m. apply (continuous_comp (fun u => eta a u ^ m) Rinv); [apply P|]. apply continuous_Rinv. apply pow_nonzero.
    apply Rgt_not_eq, eta_positive. exact Ht. }
  apply (continuous_minus (fun u => control a h (by_agent x) u j) (fun _ => sum n (fun l => at_ (plant a) l * x (l, j))));
    [|apply continuous_const].
  apply (continuous_minus (fun _ => at_ (plant a) 0 * h j) (fun u => eta a u ^ degree a * sum (degree a) (fun i =>
    at_ (gains a) i * lap (edges c) (y a h (by_agent x) u i) j + at_ (damping a) i * y a h (by_agent x) u i j)));
    [apply continuous_const|].
  apply continuous_times; [apply P|]. apply (continuous_sum (degree a) (fun u i =>
    at_ (gains a) i * lap (edges c) (y a h (by_agent x) u i) j + at_ (damping a) i * y a h (by_agent x) u i j)). intros l _.
  apply (continuous_ext (fun u => (at_ (gains a) l * lap (edges c) (placed h (by_agent x) l) j +
    at_ (damping a) l * placed h (by_agent x) l j) * / eta a u ^ l)).
  - intros u. replace (y a h (by_agent x) u l) with (fun j => / eta a u ^ l * placed h (by_agent x) l j)
      by (apply functional_extensionality; intros; unfold y, Rdiv; ring). rewrite lap_times. simpl. ring.
  - apply continuous_times; [apply continuous_const|apply I].
Qed.
Theorem flight : exists X S, flies a h X S /\ forall i j, (i < n)%nat -> (j < N)%nat -> X 0 i j = begin i j.
Proof.
  destruct (solvable (nat * nat) T moved_ first HT) as [X [X0 [CX DX]]].
  - intros v Hv. destruct (moved_bounded v Hv) as [M [HM B]].
    set (D := total n (fun i => total N (fun j => begin i j - still_ (i, j)))). assert (HD : 0 <= D) by apply total_pos.
    exists (M * (1 + D)). split; [apply Rmult_le_pos; lra|]. intros t p Ht. specialize (B t p Ht). split.
    + rewrite <- (Rminus_0_r (moved_ t first p)), <- (moved_still t p). eapply Rle_trans; [apply (B first still_ D)|apply Rmult_le_compat_l; lra].
      intros [i j]. cbn [first]. destruct (Nat.ltb_spec i n) as [Hi|_], (Nat.ltb_spec j N) as [Hj|_]; cbn [andb];
        try (rewrite Rminus_eq_0, Rabs_R0; exact HD).
      pose proof (total_above N (fun j => begin i j - still_ (i, j)) j) as A. pose proof (total_above n (fun i => total N (fun j => begin i j - still_ (i, j))) i) as A'.
      rewrite !cut_in in A, A' by assumption. pose proof (Rle_abs (total N (fun j => begin i j - still_ (i, j)))). unfold D. lra.
    + intros x z d H. apply (bounded_le M _ (fun x => moved_ t x p)); [|exact B|exact H]. pose proof (Rmult_le_pos _ _ HM HD). lra.
  - exists (fun t i j => X t (i, j)), (fun _ _ => 0). split; [split; [|split; [reflexivity|]]|].
    + unfold slides. destruct (kind (graph a)); [reflexivity|]. intros t i e _ _ Z. contradiction (Z eq_refl).
    + intros t j Hj Ht. change (deadline (graph a)) with T in Ht. change (degree a) with n.
      assert (D : forall i, 0 < t -> is_derive (fun u => X u (i, j)) t (moved_ t (X t) (i, j))).
      { intros i H0. apply DX; [lra|]. intros z. apply moved_continuous. exact Ht. }
      split; [intros H0; split|split; [apply continuous_const|intros i _; apply CX; exact Ht]].
      * apply (is_derive_ext (fun u => X u (pred n, j))); [intros u; simpl; ring|]. specialize (D (pred n) H0). cbn [moved_] in D.
        rewrite (Nat.succ_pred_pos n Hn), Nat.eqb_refl in D. exact D.
      * intros i Hi. specialize (D i H0). cbn [moved_] in D. destruct (Nat.eqb_spec (S i) n); [lia|exact D].
    + intros i j Hi Hj. rewrite X0. cbn [first]. destruct (Nat.ltb_spec i n); [|lia]. destruct (Nat.ltb_spec j N); [reflexivity|lia].
Qed.
End Exists.
