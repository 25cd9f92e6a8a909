(** Matrices of few rows against a form of states: what is positive semidefinite stays so beside any such form; and
    polynomials on an interval, by Bernstein's. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Certificate Mean Dominance AgentCertificate.
Open Scope R_scope.

(** * Sums *)
Lemma sum_ext n f g : (forall i, (i < n)%nat -> f i = g i) -> sum n f = sum n g.
Proof. intros H. apply fsum_ext. intros i Hi. apply in_seq in Hi. apply H. lia. Qed.
Lemma sum_plus n f g : sum n (fun i => f i + g i) = sum n f + sum n g.
Proof. apply fsum_plus. Qed.
Lemma sum_scal n c f : sum n (fun i => c * f i) = c * sum n f.
Proof. apply fsum_scal. Qed.
Lemma sum_le n f g : (forall i, (i < n)%nat -> f i <= g i) -> sum n f <= sum n g.
Proof. intros H. apply fsum_le. intros i Hi. apply in_seq in Hi. apply H. lia. Qed.
Lemma sum_zero n f : (forall i, (i < n)%nat -> f i = 0) -> sum n f = 0.
Proof. intros H. rewrite (sum_ext n f (fun i => 0 * 0)) by (intros; rewrite H by assumption; ring). rewrite sum_scal. ring. Qed.
Lemma sum_swap m n f : sum m (fun i => sum n (fun j => f i j)) = sum n (fun j => sum m (fun i => f i j)).
Proof.
  unfold sum at 1 4. generalize (seq 0 m) as l. induction l as [|i l IH]; simpl.
  - symmetry. apply sum_zero. reflexivity.
  - rewrite IH, <- sum_plus. reflexivity.
Qed.
Lemma sum_at n i f : (i < n)%nat -> sum n (fun j => if (i =? j)%nat then f j else 0) = f i.
Proof. intros H. apply fsum_at. lia. Qed.
Lemma sum_at' n i f : (i < n)%nat -> sum n (fun j => (if (i =? j)%nat then 1 else 0) * f j) = f i.
Proof. intros H. rewrite <- (sum_at n i f H). apply sum_ext. intros j _. destruct (i =? j)%nat; ring. Qed.
Lemma double_ext n A G H : (forall i j, (i < n)%nat -> (j < n)%nat -> G i j = H i j) -> double n A G = double n A H.
Proof. intros E. apply sum_ext. intros i Hi. apply sum_ext. intros j Hj. rewrite E by assumption. reflexivity. Qed.

(** * Forms of two states *)
Record positive (F : (nat -> R) -> (nat -> R) -> R) : Prop := {
  swaps : forall x z, F x z = F z x;
  adds : forall x x' z, F (fun j => x j + x' j) z = F x z + F x' z;
  scales : forall c x z, F (fun j => c * x j) z = c * F x z;
  above0 : forall x, 0 <= F x x }.
(** combinations of states *)
Definition comb (n : nat) (l : nat -> R) (Y : nat -> nat -> R) : nat -> R := fun j => sum n (fun i => l i * Y i j).
Section Positive.
Variable F : (nat -> R) -> (nat -> R) -> R.
Hypothesis HF : positive F.
Lemma at_zero z : F (fun _ => 0) z = 0.
Proof. pose proof (scales F HF 0 (fun _ => 0) z) as E. cbv beta in E. rewrite Rmult_0_l in E. rewrite E at 1. ring. Qed.
Lemma of_comb n l Y z : F (comb n l Y) z = sum n (fun i => l i * F (Y i) z).
Proof.
  unfold comb, sum. generalize (seq 0 n) as s. induction s as [|i s IH]; simpl; [apply at_zero|].
  rewrite (adds F HF (fun j => l i * Y i j)), (scales F HF), IH. reflexivity.
Qed.
Lemma to_comb n l Y z : F z (comb n l Y) = sum n (fun i => l i * F z (Y i)).
Proof. rewrite (swaps F HF), of_comb. apply sum_ext. intros. rewrite (swaps F HF). reflexivity. Qed.
Lemma cauchy x z : sq (F x z) <= F x x * F z z.
Proof.
  pose proof (above0 F HF x) as X. pose proof (above0 F HF z) as Z.
  assert (E : forall u, 0 <= F x x + 2 * u * F x z + u * u * F z z).
  { intros u. pose proof (above0 F HF (fun j => x j + u * z j)) as K.
    rewrite (adds F HF), (scales F HF), (swaps F HF x), (swaps F HF z (fun j => x j + u * z j)), !(adds F HF), !(scales F HF),
      (swaps F HF z x) in K. lra. }
  unfold sq. destruct (Req_dec (F z z) 0) as [N|N].
  - assert (F x z = 0); [|nra]. destruct (Req_dec (F x z) 0) as [|M]; [assumption|].
    specialize (E (- (F x x + 1) / (2 * F x z))). rewrite N in E.
    replace (2 * (- (F x x + 1) / (2 * F x z)) * F x z) with (- (F x x + 1)) in E by (field; exact M). lra.
  - specialize (E (- F x z / F z z)).
    replace (F x x + 2 * (- F x z / F z z) * F x z + - F x z / F z z * (- F x z / F z z) * F z z)
      with (F x x - F x z * F x z / F z z) in E by (field; exact N).
    apply (Rmult_le_compat_r (F z z)) in E; [|exact Z]. unfold Rdiv in E. rewrite Rmult_0_l, Rmult_minus_distr_r in E.
    rewrite (Rmult_assoc (F x z * F x z)), Rinv_l in E by exact N. lra.
Qed.
End Positive.

(** * Positive semidefinite: a sum of squares that is given, whoever found it *)
Definition qsum (l : list Q) : Q := fold_right Qplus 0%Q l.
Definition cell (A : list (list Q)) (i j : nat) : Q := nth j (nth i A []) 0%Q.
Definition square (n : nat) (p : nat -> nat -> bool) : bool := forallb (fun i => forallb (p i) (seq 0 n)) (seq 0 n).
Definition psd (split : list (list Q) -> list (Q * list Q)) (n : nat) (A : list (list Q)) : bool :=
  let l := split A in forallb (fun d => Qle_bool 0 (fst d)) l && square n (fun i j =>
    Qeq_bool (cell A i j) (qsum (map (fun d : Q * list Q => fst d * (nth i (snd d) 0 * nth j (snd d) 0)) l)%Q)).
Lemma square_ok n p : square n p = true -> forall i j, (i < n)%nat -> (j < n)%nat -> p i j = true.
Proof.
  unfold square. rewrite forallb_forall. intros H i j Hi Hj. specialize (H i ltac:(apply in_seq; lia)).
  rewrite forallb_forall in H. apply H. apply in_seq. lia.
Qed.
Lemma Q2R_0 : Q2R 0 = 0.
Proof. unfold Q2R. simpl. ring. Qed.
Lemma Q2R_1 : Q2R 1 = 1.
Proof. unfold Q2R. simpl. field. Qed.
Theorem psd_ok split n A F Y : positive F -> psd split n A = true -> 0 <= double n A (fun i j => F (Y i) (Y j)).
Proof.
  intros HF H. unfold psd in H. cbv zeta in H. set (l := split A) in *. clearbody l. apply andb_prop in H as [N H].
  assert (E : double n A (fun i j => F (Y i) (Y j)) = fold_right (fun d a => Q2R (fst d) *
    F (comb n (at_ (snd d)) Y) (comb n (at_ (snd d)) Y) + a) 0 l).
  { transitivity (sum n (fun i => sum n (fun j =>
      fold_right (fun d a => Q2R (fst d) * (at_ (snd d) i * at_ (snd d) j) + a) 0 l * F (Y i) (Y j)))).
    - apply sum_ext. intros i Hi. apply sum_ext. intros j Hj. f_equal. pose proof (square_ok _ _ H i j Hi Hj) as K. cbv beta in K.
      apply Qeq_bool_eq, Qeq_eqR in K. unfold cell in K. unfold at_ at 1. rewrite K. clear. induction l as [|d l IH]; simpl; [apply Q2R_0|].
      rewrite Q2R_plus, !Q2R_mult, IH. reflexivity.
    - clear N H. induction l as [|d l IH]; simpl.
      + apply sum_zero. intros. apply sum_zero. intros. ring.
      + rewrite <- IH, (of_comb F HF). rewrite <- sum_scal, <- sum_plus. apply sum_ext. intros i _.
        rewrite (to_comb F HF), <- !sum_scal, <- sum_plus. apply sum_ext. intros j _. ring. }
  rewrite E. clear E H. induction l as [|d l IH]; simpl in *; [lra|]. apply andb_prop in N as [N N'].
  apply Qle_bool_iff, Qle_Rle in N. rewrite Q2R_0 in N. specialize (IH N').
  assert (0 <= Q2R (fst d) * F (comb n (at_ (snd d)) Y) (comb n (at_ (snd d)) Y)) by (apply Rmult_le_pos; [exact N|apply (above0 F HF)]). lra.
Qed.
Lemma psd_symmetric split n A i j : psd split n A = true -> (i < n)%nat -> (j < n)%nat ->
  at_ (nth i A []) j = at_ (nth j A []) i.
Proof.
  intros H Hi Hj. unfold psd in H. cbv zeta in H. apply andb_prop in H as [_ H].
  pose proof (square_ok _ _ H i j Hi Hj) as K. pose proof (square_ok _ _ H j i Hj Hi) as K'. cbv beta in K, K'.
  apply Qeq_bool_eq, Qeq_eqR in K. apply Qeq_bool_eq, Qeq_eqR in K'. unfold cell in *. unfold at_. rewrite K, K'.
  clear. generalize (split A) as l. induction l as [|d l IH]; simpl; [reflexivity|]. rewrite !Q2R_plus, IH, !Q2R_mult. ring.
Qed.

(** * Polynomials *)
Fixpoint padd (p q : list Q) : list Q := match p, q with [], _ => q | _, [] => p | a :: p', b :: q' => (a + b)%Q :: padd p' q' end.
Definition pscale (c : Q) (p : list Q) : list Q := map (Qmult c) p.
Fixpoint peval (p : list Q) (x : R) : R := match p with [] => 0 | a :: p' => Q2R a + x * peval p' x end.
Lemma peval_padd p : forall q x, peval (padd p q) x = peval p x + peval q x.
Proof. induction p as [|a p IH]; intros [|b q] x; simpl; try ring. rewrite IH, Q2R_plus. ring. Qed.
Lemma peval_pscale c p x : peval (pscale c p) x = Q2R c * peval p x.
Proof. induction p as [|a p IH]; simpl; [ring|]. unfold pscale in *. rewrite IH, Q2R_mult. ring. Qed.
(** [p(l + w x)] *)
Fixpoint moved (l w : Q) (p : list Q) : list Q :=
  match p with [] => [] | a :: p' => let q := moved l w p' in padd [a] (padd (pscale l q) (0%Q :: pscale w q)) end.
Lemma moved_ok l w p x : peval (moved l w p) x = peval p (Q2R l + Q2R w * x).
Proof.
  induction p as [|a p IH]; cbn [moved peval]; [reflexivity|]. cbv zeta. rewrite !peval_padd. cbn [peval].
  rewrite !peval_pscale, IH, Q2R_0. ring.
Qed.
(** [sum_i l_i x^i z^(m - i)], [m + 1] the length; binomial coefficients; those of a polynomial of [x] where [x + z = 1] *)
Fixpoint hom (l : list Q) (x z : R) : R := match l with [] => 0 | a :: l' => Q2R a * z ^ length l' + x * hom l' x z end.
Fixpoint binomials (m : nat) : list Q := match m with O => [1%Q] | S m' => let l := binomials m' in padd (l ++ [0%Q]) (0%Q :: l) end.
Fixpoint bernstein (m : nat) (p : list Q) : list Q := match m, p with
  | O, [] => [0%Q] | O, a :: _ => [a]
  | S m', [] => 0%Q :: bernstein m' []
  | S m', a :: p' => padd (pscale a (binomials m)) (0%Q :: bernstein m' p') end.
Lemma padd_length p : forall q, length p = length q -> length (padd p q) = length p.
Proof. induction p as [|a p IH]; intros [|b q] H; simpl in *; auto. Qed.
Lemma binomials_length m : length (binomials m) = S m.
Proof. induction m as [|m IH]; cbn [binomials]; [reflexivity|]. cbv zeta. rewrite padd_length; rewrite ?app_length; simpl; rewrite ?IH; lia. Qed.
Lemma bernstein_length m : forall p, length (bernstein m p) = S m.
Proof.
  induction m as [|m IH]; intros [|a p]; cbn [bernstein]; try reflexivity; [simpl; rewrite IH; reflexivity|].
  unfold pscale. rewrite padd_length; rewrite map_length, binomials_length; simpl; rewrite ?IH; reflexivity.
Qed.
Lemma hom_padd p : forall q x z, length p = length q -> hom (padd p q) x z = hom p x z + hom q x z.
Proof.
  induction p as [|a p IH]; intros [|b q] x z H; simpl in *; try discriminate; [ring|]. injection H as H.
  rewrite IH, Q2R_plus, padd_length, H by assumption. ring.
Qed.
Lemma hom_pscale c p x z : hom (pscale c p) x z = Q2R c * hom p x z.
Proof. induction p as [|a p IH]; simpl; [ring|]. unfold pscale in *. rewrite IH, Q2R_mult, map_length. ring. Qed.
Lemma hom_end p x z : hom (p ++ [0%Q]) x z = z * hom p x z.
Proof. induction p as [|a p IH]; simpl; [rewrite Q2R_0; ring|]. rewrite IH, app_length, Nat.add_comm. simpl. ring. Qed.
Lemma hom_binomials m x z : hom (binomials m) x z = (x + z) ^ m.
Proof.
  induction m as [|m IH]; cbn [binomials]; [simpl; rewrite Q2R_1; ring|]. cbv zeta.
  rewrite hom_padd by (rewrite app_length; simpl; lia). rewrite hom_end. cbn [hom]. rewrite IH, Q2R_0. simpl. ring.
Qed.
Theorem bernstein_ok m : forall p x, (length p <= S m)%nat -> hom (bernstein m p) x (1 - x) = peval p x.
Proof.
  induction m as [|m IH]; intros [|a p] x H; cbn [bernstein].
  - simpl. rewrite Q2R_0. ring.
  - destruct p; [|simpl in H; lia]. simpl. ring.
  - cbn [hom]. rewrite IH by (simpl; lia). rewrite Q2R_0. simpl. ring.
  - rewrite hom_padd; [|unfold pscale; rewrite map_length, binomials_length; simpl; rewrite bernstein_length; reflexivity].
    rewrite hom_pscale, hom_binomials. cbn [hom peval]. rewrite IH by (simpl in H; lia). rewrite Q2R_0.
    replace (x + (1 - x)) with 1 by ring. rewrite pow1. ring.
Qed.
(** term by term *)
Lemma hom_sum l x z : hom l x z = sum (length l) (fun i => at_ l i * (x ^ i * z ^ (pred (length l) - i))).
Proof.
  induction l as [|a l IH]; [reflexivity|]. cbn [hom length]. unfold sum. cbn [seq fold_right]. rewrite <- seq_shift.
  f_equal; [unfold at_; simpl; rewrite Nat.sub_0_r; ring|]. rewrite IH, <- sum_scal. unfold sum.
  generalize (seq_length (length l) 0). assert (G : forall i, In i (seq 0 (length l)) -> (i < length l)%nat) by (intros i Hi; apply in_seq in Hi; lia).
  revert G. generalize (seq 0 (length l)) as s. intros s G _. induction s as [|i s IHs]; simpl; [reflexivity|].
  rewrite IHs by (intros; apply G; right; assumption). f_equal. specialize (G i ltac:(left; reflexivity)).
  replace (length l - S i)%nat with (pred (length l) - i)%nat by lia. unfold at_. simpl. ring.
Qed.
