(** The function of all derivatives falls: the algebra of it. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia Psatz FunctionalExtensionality.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Certificate AgentCertificate AgentForms.
Open Scope R_scope.

Section Fall.
Variables (F : (nat -> R) -> (nat -> R) -> R) (L : (nat -> R) -> nat -> R) (n : nat) (w p A : nat -> nat -> R) (K : nat -> R).
Variables (c r beta : R) (Y : nat -> nat -> R).
Hypothesis HF : positive F.
Hypothesis HL : forall l Z, L (comb n l Z) = comb n l (fun i => L (Z i)).
Hypothesis Hb : forall x, beta * F x x <= 2 * F (L x) x.
Hypothesis Hc : 0 < c /\ 1 <= c * beta.
Hypothesis Hn : (0 < n)%nat.
Hypothesis Hw : forall i j, (i < n)%nat -> (j < n)%nat -> w i j = w j i.
Hypothesis Hp : forall i j, (i < n)%nat -> (j < n)%nat -> p i j = p j i.
Hypothesis Hi : forall i j, (i < n)%nat -> (j < n)%nat -> sum n (fun l => w i l * p l j) = if (i =? j)%nat then 1 else 0.
Hypothesis HK : forall i, (i < n)%nat -> sum n (fun l => w i l * K l) = if (S i =? n)%nat then c else 0.
Let b := pred n.
Let Z (i : nat) := comb n (p i) Y.
Let G i j := F (Z i) (Z j).
Definition moving (i : nat) : nat -> R := fun j =>
  comb n (A i) Y j + (if (S i =? n)%nat then -1 else 0) * comb n K (fun l => L (Y l)) j.
Lemma back i : (i < n)%nat -> Y i = comb n (w i) Z.
Proof.
  intros H. apply functional_extensionality. intros j. unfold comb at 1, Z, comb.
  rewrite (sum_ext n _ (fun l => sum n (fun m => w i l * p l m * Y m j))).
  - rewrite sum_swap, (sum_ext n _ (fun m => (if (i =? m)%nat then 1 else 0) * Y m j)); [symmetry; apply (sum_at' n i (fun m => Y m j)); exact H|].
    intros m Hm. rewrite <- Hi by assumption. rewrite (Rmult_comm (sum n _)), <- sum_scal. apply sum_ext. intros. ring.
  - intros l _. rewrite <- sum_scal. apply sum_ext. intros. ring.
Qed.
Lemma steers : comb n K Y = fun j => c * Z b j.
Proof.
  apply functional_extensionality. intros j. unfold comb at 1.
  rewrite (sum_ext n _ (fun i => sum n (fun l => K i * w i l * Z l j))).
  - rewrite sum_swap, (sum_ext n _ (fun l => (if (b =? l)%nat then 1 else 0) * (c * Z l j))); [apply (sum_at' n b (fun l => c * Z l j)); unfold b; lia|].
    intros l Hl. transitivity (sum n (fun i => w l i * K i) * Z l j).
    + rewrite (Rmult_comm (sum n _)), <- sum_scal. apply sum_ext. intros i Hi'. rewrite (Hw l i) by assumption. ring.
    + rewrite HK by assumption. unfold b. destruct (Nat.eqb_spec (S l) n), (Nat.eqb_spec (pred n) l); try lia; ring.
  - intros i H. transitivity (K i * comb n (w i) Z j); [rewrite <- (back i H); reflexivity|]. unfold comb. rewrite <- sum_scal. apply sum_ext. intros. ring.
Qed.
Lemma worth (U : nat -> nat -> R) : sum n (fun i => sum n (fun j => p i j * F (U i) (Y j))) = sum n (fun i => F (U i) (Z i)).
Proof. apply sum_ext. intros i _. symmetry. apply (to_comb F HF). Qed.
Lemma worth_self : sum n (fun i => sum n (fun j => p i j * F (Y i) (Y j))) = sum n (fun i => sum n (fun j => w i j * G i j)).
Proof.
  rewrite (worth Y). apply sum_ext. intros i H. transitivity (F (comb n (w i) Z) (Z i)); [rewrite <- (back i H); reflexivity|]. rewrite (of_comb F HF). apply sum_ext. intros j _.
  unfold G. rewrite (swaps F HF (Z i)). reflexivity.
Qed.
Hypothesis Hfall : 0 <= sum n (fun i => sum n (fun j => ((if (S i =? n)%nat && (S j =? n)%nat then 1 else 0) - r * w i j
  - sum n (fun l => A i l * w l j + A j l * w i l)) * G i j)).
Theorem falling : sum n (fun i => sum n (fun j => p i j * (F (moving i) (Y j) + F (Y i) (moving j))))
  <= - r * sum n (fun i => sum n (fun j => p i j * F (Y i) (Y j))).
Proof.
  set (H := fun i j => sum n (fun l => A i l * w l j)).
  assert (E1 : sum n (fun i => sum n (fun j => p i j * (F (moving i) (Y j) + F (Y i) (moving j))))
    = 2 * sum n (fun i => F (moving i) (Z i))).
  { rewrite <- worth. rewrite (sum_ext n _ (fun i => sum n (fun j => p i j * F (moving i) (Y j)) + sum n (fun j => p i j * F (Y i) (moving j)))).
    2: { intros i _. rewrite <- sum_plus. apply sum_ext. intros. ring. }
    rewrite sum_plus. rewrite (sum_swap n n (fun i j => p i j * F (Y i) (moving j))).
    assert (E : sum n (fun j => sum n (fun i => p i j * F (Y i) (moving j))) = sum n (fun i => sum n (fun j => p i j * F (moving i) (Y j)))).
    { apply sum_ext. intros i H1. apply sum_ext. intros j H2. rewrite (Hp j i), (swaps F HF) by assumption. reflexivity. }
    rewrite E. ring. }
  assert (E2 : forall i, (i < n)%nat -> F (moving i) (Z i)
    = sum n (fun j => H i j * G i j) - (if (S i =? n)%nat then c * F (L (Z b)) (Z b) else 0)).
  { intros i Hlt. unfold moving. rewrite (adds F HF), (scales F HF). unfold Rminus. f_equal.
    - rewrite (of_comb F HF). rewrite (sum_ext n _ (fun l => sum n (fun j => A i l * w l j * G i j))).
      + rewrite sum_swap. apply sum_ext. intros j _. unfold H. rewrite (Rmult_comm (sum n _)), <- sum_scal. apply sum_ext. intros. ring.
      + intros l Hl. transitivity (A i l * F (comb n (w l) Z) (Z i)); [rewrite <- (back l Hl); reflexivity|]. rewrite (of_comb F HF), <- sum_scal. apply sum_ext. intros j _. unfold G.
        rewrite (swaps F HF (Z i)). ring.
    - destruct (Nat.eqb_spec (S i) n) as [E|]; [|ring]. replace i with b by (unfold b; lia).
      rewrite <- HL, steers. assert (EL : L (fun j => c * Z b j) = fun j => c * L (Z b) j).
      { assert (C : (fun j => c * Z b j) = comb n (fun l => if (b =? l)%nat then c else 0) Z).
        { apply functional_extensionality. intros j. unfold comb. symmetry.
          rewrite (sum_ext n _ (fun l => if (b =? l)%nat then c * Z l j else 0)) by (intros l _; destruct (b =? l)%nat; ring).
          apply sum_at. unfold b. lia. }
        rewrite C, HL. apply functional_extensionality. intros j. unfold comb.
        rewrite (sum_ext n _ (fun l => if (b =? l)%nat then c * L (Z l) j else 0)) by (intros l _; destruct (b =? l)%nat; ring).
        apply (sum_at n b (fun l => c * L (Z l) j)). unfold b. lia. }
      rewrite EL, (scales F HF). ring. }
  assert (E3 : sum n (fun i => F (moving i) (Z i)) = sum n (fun i => sum n (fun j => H i j * G i j)) - c * F (L (Z b)) (Z b)).
  { rewrite (sum_ext n _ (fun i => sum n (fun j => H i j * G i j) + -1 * (if (b =? i)%nat then c * F (L (Z b)) (Z b) else 0))).
    - rewrite sum_plus, sum_scal, (sum_at n b (fun _ => c * F (L (Z b)) (Z b))) by (unfold b; lia). ring.
    - intros i Hlt. rewrite E2 by exact Hlt. unfold b. destruct (Nat.eqb_spec (S i) n), (Nat.eqb_spec (pred n) i); try lia; ring. }
  assert (E4 : sum n (fun i => sum n (fun j => ((if (S i =? n)%nat && (S j =? n)%nat then 1 else 0) - r * w i j
      - sum n (fun l => A i l * w l j + A j l * w i l)) * G i j))
    = G b b + - r * sum n (fun i => sum n (fun j => w i j * G i j)) + -2 * sum n (fun i => sum n (fun j => H i j * G i j))).
  { assert (S1 : G b b = sum n (fun i => sum n (fun j => (if (S i =? n)%nat && (S j =? n)%nat then 1 else 0) * G i j))).
    { rewrite (sum_ext n _ (fun i => (if (b =? i)%nat then 1 else 0) * sum n (fun j => (if (b =? j)%nat then 1 else 0) * G i j))).
      - rewrite (sum_at' n b (fun i => sum n (fun j => (if (b =? j)%nat then 1 else 0) * G i j))) by (unfold b; lia).
        symmetry. apply (sum_at' n b (fun j => G b j)). unfold b; lia.
      - intros i Hlt. rewrite <- sum_scal. apply sum_ext. intros j Hlt'. unfold b.
        destruct (Nat.eqb_spec (S i) n), (Nat.eqb_spec (pred n) i), (Nat.eqb_spec (S j) n), (Nat.eqb_spec (pred n) j); try lia; simpl; ring. }
    assert (S2 : sum n (fun i => sum n (fun j => H j i * G i j)) = sum n (fun i => sum n (fun j => H i j * G i j))).
    { rewrite sum_swap. apply sum_ext. intros i _. apply sum_ext. intros j _. unfold G. rewrite (swaps F HF). reflexivity. }
    replace (-2 * sum n (fun i => sum n (fun j => H i j * G i j))) with
      (-1 * sum n (fun i => sum n (fun j => H i j * G i j)) + -1 * sum n (fun i => sum n (fun j => H j i * G i j))) by (rewrite S2; ring).
    rewrite S1. rewrite <- !sum_scal, <- !sum_plus. apply sum_ext. intros i Hlt.
    rewrite <- !sum_scal, <- !sum_plus. apply sum_ext. intros j Hlt'.
    assert (S3 : sum n (fun l => A i l * w l j + A j l * w i l) = H i j + H j i).
    { rewrite sum_plus. f_equal. apply sum_ext. intros l Hl. rewrite (Hw i l) by assumption. reflexivity. }
    rewrite S3. ring. }
  rewrite E1, E3, worth_self. rewrite E4 in Hfall.
  pose proof (Hb (Z b)) as B. destruct Hc as [C0 C1]. pose proof (above0 F HF (Z b)) as G0. fold (G b b) in B, G0.
  assert (c * (beta * G b b) <= c * (2 * F (L (Z b)) (Z b))) by (apply Rmult_le_compat_l; lra). nra.
Qed.
(** how large a combination of derivatives is against all: [d] any linear function *)
Let S (x z : nat -> R) := sum n (fun i => sum n (fun j => w i j * (x i * z j))).
Lemma any_part (d : (nat -> R) -> R) c0 q : (forall l Z, d (comb n l Z) = sum n (fun i => l i * d (Z i))) ->
  (forall Z, 0 <= sum n (fun i => sum n (fun j => w i j * (c0 * F (Z i) (Z j) - d (Z i) * d (Z j))))) ->
  (forall u, 0 <= S u u) ->
  sq (d (comb n q Y)) <= S q q * (c0 * sum n (fun i => sum n (fun j => p i j * F (Y i) (Y j)))).
Proof.
  intros Hd HD HW. rewrite worth_self, Hd. set (u := fun j => d (Z j)). specialize (HD Z).
  assert (E : sum n (fun i => q i * d (Y i)) = S q u).
  { apply sum_ext. intros i Hlt. replace (d (Y i)) with (d (comb n (w i) Z)) by (rewrite <- (back i Hlt); reflexivity).
    rewrite Hd, <- sum_scal. apply sum_ext. intros j _. unfold u. ring. }
  rewrite E. assert (PS : positive S).
  { constructor; unfold S.
    - intros x z. rewrite sum_swap. apply sum_ext. intros j Hj. apply sum_ext. intros l Hl. rewrite (Hw l j) by assumption. ring.
    - intros x x' z. rewrite <- sum_plus. apply sum_ext. intros l _. rewrite <- sum_plus. apply sum_ext. intros. ring.
    - intros v x z. rewrite <- sum_scal. apply sum_ext. intros l _. rewrite <- sum_scal. apply sum_ext. intros. ring.
    - exact HW. }
  eapply Rle_trans; [apply (cauchy S PS)|]. apply Rmult_le_compat_l; [apply HW|].
  rewrite <- sum_scal. assert (X : sum n (fun i => sum n (fun j => w i j * (c0 * F (Z i) (Z j) - d (Z i) * d (Z j))))
    = sum n (fun i => c0 * sum n (fun j => w i j * G i j)) + -1 * S u u).
  { unfold S. rewrite <- sum_scal, <- sum_plus. apply sum_ext. intros l _. rewrite <- !sum_scal, <- sum_plus. apply sum_ext. intros j _.
    unfold G, u. ring. }
  lra.
Qed.
Lemma one_part (d : (nat -> R) -> R) c0 i : (forall l Z, d (comb n l Z) = sum n (fun i => l i * d (Z i))) ->
  (forall Z, 0 <= sum n (fun i => sum n (fun j => w i j * (c0 * F (Z i) (Z j) - d (Z i) * d (Z j))))) ->
  (forall u, 0 <= S u u) -> (i < n)%nat ->
  sq (d (Y i)) <= w i i * (c0 * sum n (fun i => sum n (fun j => p i j * F (Y i) (Y j)))).
Proof.
  intros Hd HD HW Hlt. set (e := fun l => if (i =? l)%nat then 1 else 0).
  assert (E : comb n e Y = Y i) by (apply functional_extensionality; intros j; apply (sum_at' n i (fun l => Y l j) Hlt)).
  assert (W1 : S e e = w i i).
  { unfold S. rewrite (sum_ext n _ (fun l => (if (i =? l)%nat then 1 else 0) * sum n (fun j => (if (i =? j)%nat then 1 else 0) * w l j))).
    - rewrite (sum_at' n i), (sum_at' n i) by exact Hlt. reflexivity.
    - intros l _. rewrite <- sum_scal. apply sum_ext. intros. unfold e. ring. }
  rewrite <- W1, <- E at 1. apply any_part; assumption.
Qed.
End Fall.
