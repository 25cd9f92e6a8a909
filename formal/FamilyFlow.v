(** Functions that are continuous, and of which all that is largest falls off a sequence of instants, never grow: what
    switching at countably many instants asks for. *)
Require Import List Reals Lra Lia Arith PeanoNat.
From Coquelicot Require Import Coquelicot.
Open Scope R_scope.

(** * Between two numbers is one that a sequence does not hit *)
Section Missed.
Variables (u : nat -> R) (a b : R).
Hypothesis Hab : a < b.
(** of an interval the third that does not hold a number *)
Definition third (p : R * R) (x : R) : R * R :=
  let l := fst p in let r := snd p in if Rlt_dec x ((l + r) / 2) then (l + (r - l) * (2 / 3), r) else (l, l + (r - l) / 3).
Fixpoint nest (k : nat) : R * R := match k with O => third (a + (b - a) / 3, b - (b - a) / 3) (u 0%nat) | S m => third (nest m) (u (S m)) end.
Lemma third_ok p x : fst p < snd p -> fst p <= fst (third p x) < snd (third p x) /\ snd (third p x) <= snd p /\
  (x < fst (third p x) \/ snd (third p x) < x).
Proof. destruct p as [l r]. unfold third. simpl. intros H. destruct (Rlt_dec x ((l + r) / 2)); simpl; lra. Qed.
Lemma nest_ok k : a < fst (nest k) < snd (nest k) /\ snd (nest k) < b /\ (u k < fst (nest k) \/ snd (nest k) < u k).
Proof.
  induction k as [|m IH]; cbn [nest].
  - pose proof (third_ok (a + (b - a) / 3, b - (b - a) / 3) (u 0%nat)) as T. cbn [fst snd] in T. specialize (T ltac:(lra)).
    set (p := third _ _) in *. lra.
  - pose proof (third_ok (nest m) (u (S m)) ltac:(lra)) as T. set (p := third _ _) in *. lra.
Qed.
Lemma nest_in k j : fst (nest k) <= fst (nest (j + k)) /\ snd (nest (j + k)) <= snd (nest k).
Proof.
  induction j as [|j IH]; simpl; [lra|]. destruct (nest_ok (j + k)) as [A _].
  destruct (third_ok (nest (j + k)) (u (S (j + k))) ltac:(lra)) as [B [C _]]. lra.
Qed.
Lemma missed : exists y, a < y < b /\ forall k, y <> u k.
Proof.
  destruct (completeness (fun x => exists k, x = fst (nest k))) as [y [U L]].
  - exists b. intros x [k ->]. pose proof (nest_ok k). lra.
  - exists (fst (nest 0)), 0%nat. reflexivity.
  - assert (B : forall k, y <= snd (nest k)).
    { intros k. apply L. intros x [j ->]. destruct (nest_in k j) as [A1 A2], (nest_in j k) as [B1 B2].
      pose proof (nest_ok (j + k)). rewrite Nat.add_comm in B1, B2. lra. }
    assert (A : forall k, fst (nest k) <= y) by (intros k; apply U; exists k; reflexivity).
    exists y. split.
    + pose proof (nest_ok 0). specialize (A 0%nat). specialize (B 0%nat). lra.
    + intros k E. pose proof (nest_ok k). specialize (A k). specialize (B k). lra.
Qed.
End Missed.

(** * The largest of some functions *)
Lemma right_of (P : R -> Prop) c : locally c P -> at_right c P.
Proof. intros [e H]. exists e. intros t Ht _. apply H. exact Ht. Qed.
Lemma right_all n (P : nat -> R -> Prop) c : (forall i, (i < n)%nat -> at_right c (P i)) -> at_right c (fun t => forall i, (i < n)%nat -> P i t).
Proof.
  induction n as [|n IH]; intros H.
  - apply (filter_forall (F := at_right c)). intros t i Hi. lia.
  - generalize (filter_and (F := at_right c) _ _ (IH ltac:(intros; apply H; lia)) (H n ltac:(lia))). apply (filter_imp (F := at_right c)). intros t [A B] i Hi.
    destruct (Nat.eq_dec i n) as [->|N]; [exact B|apply A; lia].
Qed.
Lemma falls_right f c l : is_derive f c l -> l < 0 -> at_right c (fun t => f t <= f c).
Proof.
  intros D H. apply is_derive_Reals in D. assert (N0 : 0 < - l) by lra. destruct (D (- l) N0) as [d Hd]. exists d. intros t Bt Lt. change R in t. change (c < t) in Lt.
  assert (B : Rabs (t - c) < d) by exact Bt.
  assert (N1 : t - c <> 0) by lra. specialize (Hd (t - c) N1 B). replace (c + (t - c)) with t in Hd by ring. apply Rabs_def2 in Hd as [Hd _].
  assert (Q : (f t - f c) / (t - c) < 0) by lra.
  apply Rnot_lt_le. intros N. assert (0 < (f t - f c) / (t - c)) by (apply Rdiv_lt_0_compat; lra). lra.
Qed.

Section Largest.
Variables (n : nat) (f : nat -> R -> R) (t0 T : R) (D : nat -> R).
Hypothesis C : forall i t, (i < n)%nat -> t0 <= t < T -> continuous (f i) t.
Hypothesis H : forall t, t0 < t < T -> (forall k, t <> D k) -> forall i, (i < n)%nat ->
  exists l, is_derive (f i) t l /\ ((forall j, (j < n)%nat -> f j t <= f i t) -> l <= 0).

Theorem never_grows M : (forall i, (i < n)%nat -> f i t0 <= M) -> forall t i, t0 <= t < T -> (i < n)%nat -> f i t <= M.
Proof.
  intros H0 t1 i1 Ht1 Hi1. apply Rnot_lt_le. intros N.
  assert (Hlt : t0 < t1). { destruct (proj1 Ht1) as [A|A]; [exact A|]. subst t1. specialize (H0 i1 Hi1). lra. }
  set (eps := (f i1 t1 - M) / (2 * (t1 - t0))).
  assert (He : 0 < eps) by (apply Rdiv_lt_0_compat; lra).
  set (g := fun i t => f i t - eps * (t - t0)).
  assert (G1 : M < g i1 t1). { unfold g, eps. replace (_ - _) with ((f i1 t1 + M) / 2) by (field; lra). lra. }
  destruct (missed (fun m => g (m mod n) (D (m / n))) M (g i1 t1) G1) as [y [[Y0 Y1] Y]].
  assert (YD : forall j k, (j < n)%nat -> y <> g j (D k)).
  { intros j k Hj E. apply (Y (j + k * n)%nat). rewrite Nat.mod_add, Nat.mod_small, Nat.div_add, Nat.div_small by lia. exact E. }
  assert (GC : forall i t, (i < n)%nat -> t0 <= t < T -> continuous (g i) t).
  { intros i t Hi Ht. apply (continuous_minus (f i) (fun t => eps * (t - t0))); [apply C; assumption|].
    apply (continuous_mult (fun _ => eps) (fun t => t - t0)); [apply continuous_const|].
    apply (continuous_minus (fun t => t) (fun _ => t0)); [apply continuous_id|apply continuous_const]. }
  set (E := fun t => t0 <= t <= t1 /\ forall j, (j < n)%nat -> g j t <= y).
  assert (E0 : E t0). { split; [lra|]. intros j Hj. unfold g. specialize (H0 j Hj). lra. }
  destruct (completeness E) as [c [U L]].
  { exists t1. intros t [A _]. lra. } { exists t0. exact E0. }
  assert (C0 : t0 <= c) by (apply U; exact E0).
  assert (C1 : c <= t1) by (apply L; intros t [A _]; lra).
  assert (Near : forall P : R -> Prop, locally c P -> exists t, E t /\ P t).
  { intros P [d Hd]. destruct (Classical_Prop.classic (exists t, E t /\ c - d < t)) as [[t [Et Lt]]|No].
    - exists t. split; [exact Et|]. apply Hd. specialize (U t Et). pose proof (cond_pos d).
      change (Rabs (t - c) < d). apply Rabs_def1; lra.
    - exfalso. pose proof (cond_pos d). assert (c <= c - d); [|lra]. apply L. intros t Et.
      apply Rnot_lt_le. intros A. apply No. exists t. split; [exact Et|lra]. }
  assert (Ec : E c).
  { split; [lra|]. intros j Hj. apply Rnot_lt_le. intros A.
    destruct (Near (fun t => y < g j t)) as [t [[_ Et] Gt]].
    - apply (GC j c Hj ltac:(lra)). apply (open_gt y). exact A.
    - specialize (Et j Hj). lra. }
  destruct Ec as [_ Ec].
  assert (C2 : c < t1). { destruct C1 as [A|A]; [exact A|]. subst c. specialize (Ec i1 Hi1). lra. }
  assert (S : at_right c (fun t => forall j, (j < n)%nat -> g j t <= y)).
  { apply right_all. intros j Hj. destruct (Ec j Hj) as [A|A].
    - apply right_of. generalize (GC j c Hj ltac:(lra) _ (open_lt y _ A)). unfold filtermap. apply filter_imp. intros t Gt. lra.
    - assert (Ct : t0 < c).
      { destruct C0 as [B|B]; [exact B|]. exfalso. subst c. unfold g in A. specialize (H0 j Hj). lra. }
      destruct (H c ltac:(lra) (fun k Ek => YD j k Hj ltac:(rewrite <- Ek; symmetry; exact A)) j Hj) as [l [Dl Nl]].
      assert (l <= 0). { apply Nl. intros j' Hj'. specialize (Ec j' Hj'). unfold g in *. lra. }
      rewrite <- A. apply (falls_right (g j) c (l - eps)); [|lra].
      apply (is_derive_minus (f j) (fun t => eps * (t - t0)) c l eps Dl).
      auto_derive; [exact I|ring]. }
  destruct S as [d Hd]. set (t := c + Rmin (d / 2) (t1 - c)).
  pose proof (cond_pos d) as Pd. pose proof (Rmin_l (d / 2) (t1 - c)). pose proof (Rmin_r (d / 2) (t1 - c)).
  assert (0 < Rmin (d / 2) (t1 - c)) by (apply Rmin_pos; lra).
  assert (Et : E t).
  { split; [unfold t; lra|]. apply Hd; [|unfold t; lra]. change (Rabs (t - c) < d). unfold t. apply Rabs_def1; lra. }
  specialize (U t Et). unfold t in U. lra.
Qed.
End Largest.

(** one function *)
Lemma falls (f : R -> R) (t0 T : R) (D : nat -> R) : (forall t, t0 <= t < T -> continuous f t) ->
  (forall t, t0 < t < T -> (forall k, t <> D k) -> exists l, is_derive f t l /\ l <= 0) ->
  forall t, t0 <= t < T -> f t <= f t0.
Proof.
  intros C H t Ht. apply (never_grows 1 (fun _ => f) t0 T D) with (i := 0%nat); auto; [|intros; lra].
  intros u Hu Hk i _. destruct (H u Hu Hk) as [l [A B]]. exists l. auto.
Qed.
