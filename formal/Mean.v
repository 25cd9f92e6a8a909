(** The upper bound on the rate by a trace. Let [F > 0] be a form on the span of [v_0 .. v_(m-1)], [A] map the span into
    itself with the matrix [a], whose first [k] rows vanish beyond column [k]. If [2 F(x, A x) >= b F(x, x)], then
    [b k <= 2 (a_00 + .. + a_(k-1)(k-1))]: take away the last vector, which changes no entry of the first [k] rows, and of
    the last [k] ones each takes [F(v, A v)/F(v, v) >= b/2] of the trace with it. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia Psatz FunctionalExtensionality.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require UpperBound.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Margin UpperProof.
Module U := UpperBound.
Open Scope R_scope.

(** * Sums *)
Fixpoint sum (m : nat) (f : nat -> R) : R := match m with O => 0 | S m' => sum m' f + f m' end.
Lemma sum_ext m f g : (forall i, (i < m)%nat -> f i = g i) -> sum m f = sum m g.
Proof. induction m as [|m IH]; intros H; simpl; [reflexivity|]. rewrite IH by (intros; apply H; lia). rewrite H by lia. reflexivity. Qed.
Lemma sum_plus m f g : sum m (fun i => f i + g i) = sum m f + sum m g.
Proof. induction m as [|m IH]; simpl; [ring|]. rewrite IH. ring. Qed.
Lemma sum_scal m c f : sum m (fun i => c * f i) = c * sum m f.
Proof. induction m as [|m IH]; simpl; [ring|]. rewrite IH. ring. Qed.
Lemma sum_zero m f : (forall i, (i < m)%nat -> f i = 0) -> sum m f = 0.
Proof. induction m as [|m IH]; intros H; simpl; [reflexivity|]. rewrite IH by (intros; apply H; lia). rewrite H by lia. ring. Qed.
Lemma sum_one m f p : (p < m)%nat -> (forall i, (i < m)%nat -> i <> p -> f i = 0) -> sum m f = f p.
Proof.
  induction m as [|m IH]; intros Hp H; [lia|]. simpl. destruct (Nat.eq_dec p m) as [->|N].
  - rewrite sum_zero by (intros; apply H; lia). ring.
  - rewrite IH by (try lia; intros; apply H; lia). rewrite (H m) by lia. ring.
Qed.

(** * The trace *)
Definition mulv (m : nat) (a : nat -> nat -> R) (x : nat -> R) (i : nat) : R := sum m (fun j => a i j * x j).
Definition quad (m : nat) (g : nat -> nat -> R) (x : nat -> R) : R := sum m (fun i => x i * mulv m g x i).
Definition unit_at (p i : nat) : R := if (i =? p)%nat then 1 else 0.
Lemma mulv_unit m a p i : (p < m)%nat -> mulv m a (unit_at p) i = a i p.
Proof.
  intros Hp. unfold mulv. rewrite (sum_one m _ p Hp).
  - unfold unit_at. rewrite Nat.eqb_refl. ring.
  - intros j _ N. unfold unit_at. destruct (Nat.eqb_spec j p); [contradiction|ring].
Qed.

Section Deflate.
Variables (m : nat) (g a : nat -> nat -> R).
Hypothesis g_sym : forall i j, g i j = g j i.
Hypothesis g_pos : 0 < g m m.
Let c j := g j m / g m m.
Definition without i j := g i j - g i m * c j.
Definition map_without i j := a i j - a i m * c j.
Definition extend (x : nat -> R) (i : nat) : R := if (i =? m)%nat then - sum m (fun j => c j * x j) else x i.
Lemma extend_mulv b x i : mulv (S m) b (extend x) i = mulv m (fun i j => b i j - b i m * c j) x i.
Proof.
  unfold mulv. simpl. unfold extend at 2. rewrite Nat.eqb_refl.
  rewrite (sum_ext m _ (fun j => b i j * x j)).
  2: { intros j Hj. unfold extend. destruct (Nat.eqb_spec j m); [lia|reflexivity]. }
  rewrite (sum_ext m (fun j => (b i j - b i m * c j) * x j) (fun j => b i j * x j + (- b i m) * (c j * x j))) by (intros; ring).
  rewrite sum_plus, sum_scal. ring.
Qed.
Lemma extend_last x : mulv (S m) g (extend x) m = 0.
Proof.
  rewrite extend_mulv. apply sum_zero. intros j _. unfold c. rewrite (g_sym m j). field. lra.
Qed.
Lemma extend_quad x : quad (S m) g (extend x) = quad m without x.
Proof.
  unfold quad. simpl sum at 1. rewrite extend_last, Rmult_0_r, Rplus_0_r. apply sum_ext. intros i Hi.
  rewrite extend_mulv. unfold extend. destruct (Nat.eqb_spec i m); [lia|reflexivity].
Qed.
Lemma extend_pair x : sum (S m) (fun i => mulv (S m) g (extend x) i * mulv (S m) a (extend x) i)
  = sum m (fun i => mulv m without x i * mulv m map_without x i).
Proof.
  simpl sum at 1. rewrite extend_last, Rmult_0_l, Rplus_0_r. apply sum_ext. intros i _. rewrite !extend_mulv. reflexivity.
Qed.
End Deflate.

Theorem trace_limit b : forall m k g a, (k <= m)%nat -> (forall i j, g i j = g j i) ->
  (forall x, 0 <= quad m g x) -> (forall x, quad m g x = 0 -> forall i, (i < m)%nat -> x i = 0) ->
  (forall x, b * quad m g x <= 2 * sum m (fun i => mulv m g x i * mulv m a x i)) ->
  (forall i j, (i < k)%nat -> (k <= j < m)%nat -> a i j = 0) -> b * INR k <= 2 * sum k (fun i => a i i).
Proof.
  induction m as [|m IH]; intros k g a Hk Hs Hn Hz Hb Ha.
  - replace k with O by lia. simpl. lra.
  - assert (Q : quad (S m) g (unit_at m) = g m m).
    { unfold quad. rewrite (sum_one (S m) _ m (Nat.lt_succ_diag_r m)).
      2: { intros j _ N. unfold unit_at. destruct (Nat.eqb_spec j m) as [E|E]; [contradiction|ring]. }
      rewrite mulv_unit by lia. unfold unit_at. rewrite Nat.eqb_refl. ring. }
    assert (P : 0 < g m m).
    { pose proof (Hn (unit_at m)) as N. rewrite Q in N. destruct (Rle_lt_or_eq_dec _ _ N) as [L|L]; [exact L|]. exfalso.
      pose proof (Hz (unit_at m) ltac:(rewrite Q; symmetry; exact L) m ltac:(lia)) as Z. unfold unit_at in Z.
      rewrite Nat.eqb_refl in Z. lra. }
    assert (I : forall k', (k' <= m)%nat -> (forall i j, (i < k')%nat -> (k' <= j < m)%nat -> map_without m g a i j = 0) ->
      b * INR k' <= 2 * sum k' (fun i => map_without m g a i i)).
    { intros k' Hk' Ha'. apply (IH k' (without m g) (map_without m g a) Hk').
      - intros i j. unfold without. rewrite (Hs i j), (Hs i m), (Hs j m). field. lra.
      - intros x. rewrite <- (extend_quad m g Hs P). apply Hn.
      - intros x Hx i Hi. rewrite <- (extend_quad m g Hs P) in Hx. pose proof (Hz _ Hx i ltac:(lia)) as Z.
        unfold extend in Z. destruct (Nat.eqb_spec i m); [lia|exact Z].
      - intros x. rewrite <- (extend_quad m g Hs P), <- (extend_pair m g a Hs P). apply Hb.
      - exact Ha'. }
    destruct (Nat.eq_dec k (S m)) as [->|N].
    + specialize (I m (le_n m) ltac:(intros; lia)). specialize (Hb (unit_at m)). rewrite Q in Hb.
      rewrite (sum_ext (S m) _ (fun i => g i m * a i m)) in Hb by (intros; rewrite !mulv_unit by lia; reflexivity).
      rewrite S_INR. simpl sum in *. unfold map_without in I.
      rewrite (sum_ext m _ (fun i => a i i + (- / g m m) * (g i m * a i m))) in I by (intros; field; lra).
      rewrite sum_plus, sum_scal in I. set (s := sum m (fun i => g i m * a i m)) in *.
      assert (K : b <= 2 * (/ g m m * s + a m m)).
      { apply (Rmult_le_reg_l (g m m)); [exact P|]. replace (g m m * (2 * (/ g m m * s + a m m))) with (2 * (s + g m m * a m m)) by (field; lra). lra. }
      lra.
    + assert (Hm : (k <= m)%nat) by lia. rewrite (sum_ext k _ (fun i => map_without m g a i i)).
      * apply I; [exact Hm|]. intros i j Hi Hj. unfold map_without. rewrite (Ha i j), (Ha i m) by lia. ring.
      * intros i Hi. unfold map_without. rewrite (Ha i m) by lia. ring.
Qed.

(** * The span of the agents that a strong component reaches *)
Lemma lap_plus es x y i : lap es (fun j => x j + y j) i = lap es x i + lap es y i.
Proof. unfold lap. induction es as [|e l IH]; simpl; [ring|]. rewrite IH. unfold lap_edge. destruct (tgt e =? i)%nat; ring. Qed.
Lemma lap_times es a x i : lap es (fun j => a * x j) i = a * lap es x i.
Proof. unfold lap. induction es as [|e l IH]; simpl; [ring|]. rewrite IH. unfold lap_edge. destruct (tgt e =? i)%nat; ring. Qed.

Section Span.
Variables (es : list edge) (R : list nat) (nu : U.state -> Rdefinitions.R) (t : nat) (ns : list nat) (k n : nat).
Let m := length ns.
Let T (x : U.state) : U.state := U.plus x (U.times (- nu x) (axis t)).
Hypothesis nu_plus : forall x z, nu (U.plus x z) = nu x + nu z.
Hypothesis nu_times : forall a x, nu (U.times a x) = a * nu x.
Hypothesis nu_lap : forall x, nu (lap es x) = 0.
Hypothesis nu_T : forall x, nu (T x) = 0.
Hypothesis R_T : forall x, supported R x -> supported R (T x).
Hypothesis R_lap : forall x, supported R x -> supported R (lap es x).
Hypothesis ns_once : NoDup ns.
Hypothesis ns_R : forall i, In i ns -> In i R /\ (i < n)%nat.
Hypothesis ns_T : forall x i, In i ns -> T x i = x i.
Hypothesis cover : forall z, supported R z -> nu z = 0 -> (forall i, In i ns -> z i = 0) -> forall i, z i = 0.

Let at_ (p : nat) : nat := nth p ns O.
Let v (p : nat) : U.state := T (axis (at_ p)).
Fixpoint combined (j : nat) (x : nat -> Rdefinitions.R) : U.state :=
  match j with O => U.times 0 (fun _ => 0) | S j' => U.plus (combined j' x) (U.times (x j') (v j')) end.
Let E := combined m.
Lemma at_in p : (p < m)%nat -> In (at_ p) ns.
Proof. intros H. apply nth_In. exact H. Qed.
Lemma v_at p q : (p < m)%nat -> (q < m)%nat -> v q (at_ p) = if (p =? q)%nat then 1 else 0.
Proof.
  intros Hp Hq. unfold v. rewrite ns_T by (apply at_in; exact Hp). unfold axis. destruct (Nat.eqb_spec p q) as [->|N].
  - rewrite Nat.eqb_refl. reflexivity.
  - destruct (Nat.eqb_spec (at_ p) (at_ q)) as [A|A]; [|reflexivity]. exfalso. apply N.
    apply (proj1 (NoDup_nth ns O) ns_once p q Hp Hq A).
Qed.
Lemma combined_nu j x : nu (combined j x) = 0.
Proof.
  induction j as [|j IH]; simpl; [rewrite nu_times; ring|]. rewrite nu_plus, nu_times, IH. unfold v. rewrite nu_T. ring.
Qed.
Lemma combined_R j x : (j <= m)%nat -> supported R (combined j x).
Proof.
  induction j as [|j IH]; intros Hj i Hi; simpl; unfold U.plus, U.times; [ring|]. rewrite (IH ltac:(lia) i Hi). unfold v.
  rewrite (R_T (axis (at_ j))); [ring| |exact Hi]. intros q Hq. unfold axis. destruct (Nat.eqb_spec q (at_ j)) as [->|N]; [|reflexivity].
  exfalso. apply Hq. apply (ns_R (at_ j)). apply at_in. lia.
Qed.
Lemma combined_at j x i : combined j x i = sum j (fun q => v q i * x q).
Proof. induction j as [|j IH]; simpl; unfold U.plus, U.times; [ring|]. rewrite IH. ring. Qed.
Lemma E_at x p : (p < m)%nat -> E x (at_ p) = x p.
Proof.
  intros Hp. unfold E. rewrite combined_at, (sum_one m _ p Hp).
  - rewrite v_at, Nat.eqb_refl by exact Hp. ring.
  - intros q Hq N. rewrite v_at by assumption. destruct (Nat.eqb_spec p q); [congruence|ring].
Qed.
Lemma E_all z : supported R z -> nu z = 0 -> z = E (fun p => z (at_ p)).
Proof.
  intros Hz Hn. set (y := E _). assert (K : forall i, U.plus z (U.times (- 1) y) i = 0).
  { apply cover.
    - intros i Hi. unfold U.plus, U.times. rewrite (Hz i Hi). unfold y, E. rewrite (combined_R m _ (le_n m) i Hi). ring.
    - rewrite nu_plus, nu_times, Hn. unfold y, E. rewrite combined_nu. ring.
    - intros i Hi. apply (In_nth ns i O) in Hi as [p [Hp <-]]. unfold U.plus, U.times. fold (at_ p). unfold y. rewrite E_at by exact Hp. ring. }
  apply functional_extensionality. intros i. specialize (K i). unfold U.plus, U.times in K. lra.
Qed.

(** the matrix of [L] on these vectors *)
Let a (p q : nat) : Rdefinitions.R := lap es (v q) (at_ p).
Lemma lap_combined j x i : lap es (combined j x) i = sum j (fun q => lap es (v q) i * x q).
Proof.
  induction j as [|j IH]; simpl.
  - unfold U.times. rewrite lap_times. ring.
  - unfold U.plus, U.times. rewrite lap_plus, lap_times. rewrite <- IH. ring.
Qed.
Lemma lap_E x : lap es (E x) = E (mulv m a x).
Proof.
  rewrite (E_all (lap es (E x))); [|apply R_lap; apply combined_R; lia|apply nu_lap]. f_equal.
  apply functional_extensionality. intros p. unfold E at 1. rewrite lap_combined. reflexivity.
Qed.

Variables (F : U.state -> U.state -> Rdefinitions.R) (b : Rdefinitions.R).
Hypothesis HF : U.form F.
Hypothesis F_pos : forall x, 0 <= F x x.
Hypothesis F_zero : forall x, supported R x -> nu x = 0 -> F x x = 0 -> forall i, (i < n)%nat -> x i = 0.
Hypothesis F_rate : forall x, b * F x x <= 2 * F x (lap es x).
Let g (p q : nat) : Rdefinitions.R := F (v p) (v q).
Lemma F_combined j x z : F (combined j x) z = sum j (fun p => x p * F (v p) z).
Proof.
  induction j as [|j IH]; simpl; [rewrite (U.mul F HF); ring|]. rewrite (U.add F HF), (U.mul F HF), IH. reflexivity.
Qed.
Lemma F_v p x : F (v p) (E x) = mulv m g x p.
Proof.
  rewrite (U.sym F HF). unfold E. rewrite F_combined. apply sum_ext. intros q _. unfold g. rewrite (U.sym F HF (v q)). ring.
Qed.
Theorem mean_limit : (k <= m)%nat -> (forall i j, (i < k)%nat -> (k <= j < m)%nat -> a i j = 0) ->
  b * INR k <= 2 * sum k (fun i => a i i).
Proof.
  intros Hk Ha. apply (trace_limit b m k g a Hk).
  - intros p q. apply (U.sym F HF).
  - intros x. replace (quad m g x) with (F (E x) (E x)); [apply F_pos|]. unfold E at 1. rewrite F_combined.
    apply sum_ext. intros p _. rewrite F_v. reflexivity.
  - intros x Hx p Hp. rewrite <- (E_at x p Hp). apply F_zero.
    + apply combined_R. lia.
    + apply combined_nu.
    + rewrite <- Hx. unfold E at 1. rewrite F_combined. apply sum_ext. intros q _. rewrite F_v. reflexivity.
    + apply (ns_R (at_ p)). apply at_in. exact Hp.
  - intros x. pose proof (F_rate (E x)) as K. replace (quad m g x) with (F (E x) (E x)).
    2: { unfold E at 1. rewrite F_combined. apply sum_ext. intros p _. rewrite F_v. reflexivity. }
    replace (sum m (fun i => mulv m g x i * mulv m a x i)) with (F (E x) (lap es (E x))); [exact K|].
    rewrite lap_E, (U.sym F HF). unfold E at 1. rewrite F_combined. apply sum_ext. intros p _. rewrite F_v. ring.
  - exact Ha.
Qed.
(** the trace, if [nu] is a sum over these first agents and [t], or 0 *)
Theorem mean_trace : (k <= m)%nat ->
  (forall z, nu z = sum k (fun p => nu (axis (at_ p)) * z (at_ p)) + nu (axis t) * z t) ->
  sum k (fun i => a i i) = sum k (fun p => lap es (axis (at_ p)) (at_ p)) + nu (axis t) * lap es (axis t) t.
Proof.
  intros Hk Hnu. pose proof (nu_lap (axis t)) as Z. rewrite Hnu in Z.
  rewrite (sum_ext k _ (fun p => lap es (axis (at_ p)) (at_ p) + - 1 * (nu (axis (at_ p)) * lap es (axis t) (at_ p)))).
  - rewrite sum_plus, sum_scal. lra.
  - intros p _. unfold a, v, T. unfold U.plus, U.times. rewrite lap_plus, lap_times. ring.
Qed.
End Span.

(** * From the check to the upper bound *)
Definition fsum (l : list nat) (f : nat -> R) : R := fold_right (fun i a => f i + a) 0 l.
Lemma fsum_ext l f g : (forall i, In i l -> f i = g i) -> fsum l f = fsum l g.
Proof. induction l as [|i l IH]; intros H; simpl; [reflexivity|]. rewrite IH by (intros; apply H; right; assumption). rewrite H by (left; reflexivity). reflexivity. Qed.
Lemma fsum_scal l c f : fsum l (fun i => c * f i) = c * fsum l f.
Proof. induction l as [|i l IH]; simpl; [ring|]. rewrite IH. ring. Qed.
Lemma fsum_filter P l f : (forall i, In i l -> P i = false -> f i = 0) -> fsum (filter P l) f = fsum l f.
Proof.
  induction l as [|i l IH]; intros H; simpl; [reflexivity|]. rewrite <- IH by (intros; apply H; [right|]; assumption).
  destruct (P i) eqn:E; simpl; [reflexivity|]. rewrite (H i) by (auto; left; reflexivity). ring.
Qed.
Definition other (t i : nat) : bool := negb (i =? t)%nat.
Lemma fsum_absent t l : ~ In t l -> filter (other t) l = l.
Proof.
  induction l as [|i l IH]; intros H; simpl; [reflexivity|]. unfold other at 1. destruct (Nat.eqb_spec i t) as [->|N].
  - exfalso. apply H. left. reflexivity.
  - simpl. rewrite IH; [reflexivity|]. intros K. apply H. right. exact K.
Qed.
Lemma fsum_split t l f : NoDup l -> In t l -> fsum l f = fsum (filter (other t) l) f + f t.
Proof.
  induction l as [|i l IH]; intros N H; [destruct H|]. inversion N; subst. simpl. unfold other at 1.
  destruct (Nat.eqb_spec i t) as [->|D]; simpl.
  - rewrite (fsum_absent t l) by assumption. ring.
  - rewrite IH; [ring|assumption|]. destruct H as [H|H]; [contradiction|exact H].
Qed.
Lemma sum_first m f : sum (S m) f = f O + sum m (fun i => f (S i)).
Proof. induction m as [|m IH]; [simpl; ring|]. change (sum (S (S m)) f) with (sum (S m) f + f (S m)). rewrite IH. simpl. ring. Qed.
Lemma sum_list l l' f : sum (length l) (fun p => f (nth p (l ++ l') O)) = fsum l f.
Proof. induction l as [|i l IH]; [reflexivity|]. simpl length. rewrite sum_first. simpl. rewrite IH. reflexivity. Qed.
Lemma dot_seq l : forall n z, (length l <= n)%nat -> dot l z = fsum (seq 0 n) (fun i => IZR (nth i l 0%Z) * z i).
Proof.
  induction l as [|a l IH]; intros n z H.
  - simpl. unfold fsum. induction (seq 0 n) as [|i s IHs]; simpl; [reflexivity|]. rewrite <- IHs. destruct i; ring.
  - destruct n as [|n]; [simpl in H; lia|]. simpl. rewrite (IH n (shift z)) by (simpl in H; lia). f_equal. rewrite <- seq_shift.
    unfold fsum. induction (seq 0 n) as [|i s IHs]; simpl; [reflexivity|]. rewrite IHs. reflexivity.
Qed.
Lemma zsum_fsum l h : IZR (zsum (map h l)) = fsum l (fun i => IZR (h i)).
Proof. induction l as [|i l IH]; [reflexivity|]. unfold zsum in *. simpl. rewrite plus_IZR, IH. reflexivity. Qed.
Lemma length_fsum l : INR (length l) = fsum l (fun _ => 1).
Proof. induction l as [|i l IH]; [reflexivity|]. simpl length. rewrite S_INR, IH. simpl. ring. Qed.

Section Trace.
Variables (c : cert) (u : upper) (C : list nat).
Let d := prepare c.
Let n := order c.
Let es := edges c.
Let R := reach n es C.
Hypothesis Hls : good (dls d) (map wt es) = true.
Hypothesis Hgood : forall p, In p (balanced_comps (comps c)) -> good (dsv d) (snd (snd p)) = true.
Hypothesis Hnull : forall p, In p (balanced_comps (comps c)) -> forall x, qdot (snd (snd p)) (lap es x) = 0.
Hypothesis Hkernel : forall x, (forall i, (i < n)%nat -> lap es x i = 0) -> forall i, (i < n)%nat -> x i = end_state c x i.
Hypothesis Hregion : check_region c d C R = true.
Let own := filter (fun i => mem i C) (seq 0 n).
Let rest := filter (fun i => mem i R && negb (mem i C)) (seq 0 n).
Let trace := zsum (map (fun i => nth i (nth i (dL d) []) 0%Z) own).

Lemma in_own i : In i own <-> (i < n)%nat /\ In i C.
Proof. unfold own. rewrite filter_In, in_seq, mem_In. intuition lia. Qed.
Lemma in_rest i : In i rest <-> (i < n)%nat /\ In i R /\ ~ In i C.
Proof.
  unfold rest. rewrite filter_In, in_seq, andb_true_iff, negb_true_iff, mem_In. split.
  - intros [H [HR HC]]. split; [lia|]. split; [exact HR|]. intros K. apply mem_In in K. congruence.
  - intros [H [HR HC]]. split; [lia|]. split; [exact HR|]. destruct (mem i C) eqn:E; [|reflexivity].
    apply mem_In in E. contradiction.
Qed.
Lemma own_once : NoDup own. Proof. apply NoDup_filter, seq_NoDup. Qed.
Lemma once P : NoDup (filter P own ++ rest).
Proof.
  assert (G : forall l l' : list nat, NoDup l -> NoDup l' -> (forall i, In i l -> ~ In i l') -> NoDup (l ++ l')).
  { induction l as [|i l IH]; intros l' N N' H; [exact N'|]. inversion N; subst. simpl. constructor.
    - rewrite in_app_iff. intros [K|K]; [contradiction|]. apply (H i); [left; reflexivity|exact K].
    - apply IH; auto. intros j Hj. apply H. right. exact Hj. }
  apply G; [apply NoDup_filter, own_once|apply NoDup_filter, seq_NoDup|].
  intros i Hi Hr. apply filter_In in Hi as [Hi _]. apply in_own in Hi. apply in_rest in Hr. tauto.
Qed.
Lemma trace_own : IZR trace = IZR (dls d) * fsum own (fun i => lap es (axis i) i).
Proof.
  unfold trace. rewrite zsum_fsum, <- fsum_scal. apply fsum_ext. intros i Hi. apply in_own in Hi as [Hi _].
  rewrite <- dot_axis. exact (app_lmat (dls d) es n (axis i) i Hls Hi).
Qed.
(** in [C] nothing is heard of the others that [C] reaches *)
Lemma unheard x : supported R x -> (forall i, In i C -> x i = 0) -> forall i, In i C -> lap es x i = 0.
Proof.
  intros Hx HC i Hi. destruct (region_parts c Hgood C Hregion) as [Hin _].
  assert (Z : lap es (fun _ => 0) i = 0).
  { unfold lap. generalize es. clear. intros l. induction l as [|e l IH]; simpl; [reflexivity|]. rewrite IH. unfold lap_edge.
    destruct (tgt e =? i)%nat; ring. }
  rewrite <- Z. apply (lap_agrees es (fun j => mem j C)).
  - intros j Hj. apply HC. apply mem_In. exact Hj.
  - intros e He Ht. destruct (Hin e He Ht) as [K|K]; [apply HC, mem_In; exact K|apply Hx; exact K].
  - apply mem_In. exact Hi.
Qed.
(** [2 trace <= bound r] *)
Lemma enough_ok (b r : Rdefinitions.R) z q : IZR z = r -> (0 <? z)%Z = true ->
  (2 * trace * Zpos (Qden q) <=? Qnum q * z * dls d)%Z = true ->
  b * r <= 2 * fsum own (fun i => lap es (axis i) i) -> b <= Q2R q.
Proof.
  intros <- Hz H K. apply Z.ltb_lt, IZR_lt in Hz. apply Z.leb_le, IZR_le in H. rewrite !mult_IZR, trace_own in H.
  destruct (good_ok _ _ Hls) as [Pl _]. apply IZR_lt in Pl. assert (Pd : 0 < IZR (Zpos (Qden q))) by (apply IZR_lt; reflexivity).
  apply (Rmult_le_reg_r (IZR z)); [exact Hz|]. eapply Rle_trans; [exact K|]. set (s := fsum own _) in *. unfold Q2R.
  apply (Rmult_le_reg_l (IZR (dls d) * IZR (Zpos (Qden q)))); [apply Rmult_lt_0_compat; assumption|].
  replace (IZR (dls d) * IZR (Zpos (Qden q)) * (IZR (Qnum q) * / IZR (Zpos (Qden q)) * IZR z))
    with (IZR (Qnum q) * IZR z * IZR (dls d)) by (field; lra). lra.
Qed.

(** with a linear function [nu] that [L] annihilates, and an axis along which it is projected to 0; or [nu = 0] *)
Lemma trace_from (nu : U.state -> Rdefinitions.R) (t : nat) (P : nat -> bool) (F : U.state -> U.state -> Rdefinitions.R) b :
  (forall x z, nu (U.plus x z) = nu x + nu z) -> (forall a x, nu (U.times a x) = a * nu x) ->
  (forall x, nu (lap es x) = 0) -> (forall x, nu (U.plus x (U.times (- nu x) (axis t))) = 0) ->
  (forall x i, In i (filter P own ++ rest) \/ ~ In i R -> nu x * axis t i = 0) ->
  (forall z, supported R z -> nu z = 0 -> (forall i, In i (filter P own ++ rest) -> z i = 0) -> forall i, z i = 0) ->
  (forall x, (forall i, In i C -> x i = 0) -> nu x = 0) ->
  (forall z, nu z = fsum (filter P own) (fun i => nu (axis i) * z i) + nu (axis t) * z t) ->
  (forall x, supported R x -> nu x = 0 -> forall p, In p (balanced_comps (comps c)) -> qdot (snd (snd p)) x = 0) ->
  U.form F -> (forall x, 0 <= F x x) -> (forall x, F x x = 0 -> forall i, (i < n)%nat -> lap es x i = 0) ->
  (forall x, b * F x x <= 2 * F x (lap es x)) ->
  b * INR (length (filter P own)) <= 2 * (fsum (filter P own) (fun i => lap es (axis i) i) + nu (axis t) * lap es (axis t) t).
Proof.
  intros Np Nt Nl NT Na Nc N0 Ns Nz HF F0 Fk Fb. destruct (region_parts c Hgood C Hregion) as [_ [RR [HCR [Rn _]]]].
  set (ns := filter P own ++ rest) in *. set (k := length (filter P own)).
  assert (Rlap : forall x, supported R x -> supported R (lap es x)) by (apply lap_supported; exact RR).
  assert (NsR : forall i, In i ns -> In i R /\ (i < n)%nat).
  { intros i Hi. apply in_app_iff in Hi as [Hi|Hi].
    - apply filter_In in Hi as [Hi _]. apply in_own in Hi as [Hn HC]. split; [apply HCR; exact HC|exact Hn].
    - apply in_rest in Hi. tauto. }
  assert (RT : forall x, supported R x -> supported R (U.plus x (U.times (- nu x) (axis t)))).
  { intros x Hx i Hi. unfold U.plus, U.times. rewrite (Hx i Hi). pose proof (Na x i (or_intror Hi)). lra. }
  assert (Tx : forall x i, In i ns -> U.plus x (U.times (- nu x) (axis t)) i = x i).
  { intros x i Hi. unfold U.plus, U.times. pose proof (Na x i (or_introl Hi)). lra. }
  assert (Kn : (k <= length ns)%nat) by (unfold ns, k; rewrite app_length; lia).
  assert (Fz : forall x, supported R x -> nu x = 0 -> F x x = 0 -> forall i, (i < n)%nat -> x i = 0).
  { intros x Hx Hx0 Z i Hi. rewrite (Hkernel x (Fk x Z) i Hi). apply end_zero. intros p Hp. apply Nz; assumption. }
  assert (First : forall p, (p < k)%nat -> In (nth p ns O) C).
  { intros p Hp. unfold ns. rewrite app_nth1 by exact Hp. pose proof (nth_In (filter P own) O Hp) as I.
    apply filter_In in I as [I _]. apply in_own in I. tauto. }
  eapply Rle_trans; [eapply (mean_limit es R nu t ns k n); try eassumption; try exact (once P)|].
  - intros i j Hi Hj. apply unheard; [| |apply First; exact Hi].
    + apply RT. intros q Hq. unfold axis. destruct (Nat.eqb_spec q (nth j ns O)) as [->|D]; [|reflexivity].
      exfalso. apply Hq. apply NsR. apply nth_In. lia.
    + assert (J : ~ In (nth j ns O) C).
      { unfold ns. rewrite app_nth2 by (unfold k in Hj; lia). intros K.
        assert (I : In (nth (j - length (filter P own)) rest O) rest).
        { apply nth_In. unfold ns, k in Hj. rewrite app_length in Hj. lia. }
        apply in_rest in I. tauto. }
      assert (A0 : forall q, In q C -> axis (nth j ns O) q = 0).
      { intros q Hq. unfold axis. destruct (Nat.eqb_spec q (nth j ns O)) as [->|D]; [contradiction|reflexivity]. }
      intros q Hq. unfold U.plus, U.times. rewrite (A0 q Hq), (N0 _ A0). ring.
  - rewrite (mean_trace es nu t ns k Nl Kn).
    + apply Req_le. f_equal. f_equal. apply (sum_list (filter P own) rest (fun i => lap es (axis i) i)).
    + intros z. rewrite Ns at 1. f_equal. symmetry. apply (sum_list (filter P own) rest (fun i => nu (axis i) * z i)).
Qed.

Lemma trace_upper : check_trace c d (bound u) C = true -> upper_claim c u.
Proof.
  intros H F b Fs Fl F0 Fk Fb. pose proof (linear_form F Fs Fl) as HF.
  destruct (region_parts c Hgood C Hregion) as [_ [_ [HCR [Rn [Own Sub]]]]]. fold n es R in HCR, Rn, Own.
  unfold check_trace in H. cbv zeta in H. fold n own trace in H.
  revert H Own Sub. destruct (ends_of c C) as [|b0 [|b1 l']]; intros H Own Sub; [| |discriminate].
  - apply andb_prop in H as [H1 H2].
    apply (enough_ok b (INR (length own)) (Z.of_nat (length own)) (bound u)); [symmetry; apply INR_IZR_INZ|exact H1|exact H2|].
    assert (Eo : filter (fun _ : nat => true) own = own).
    { generalize own. clear. intros l. induction l as [|i l IH]; simpl; [reflexivity|rewrite IH; reflexivity]. }
    pose proof (trace_from (fun _ => 0) n (fun _ => true) F b) as M. rewrite Eo in M.
    replace (fsum own _) with (fsum own (fun i => lap es (axis i) i) + 0 * lap es (axis n) n) by ring.
    apply M; auto; try (intros; ring).
    + intros z Hz _ Hi i. destruct (in_dec Nat.eq_dec i R) as [I|I]; [|apply Hz; exact I]. apply Hi. apply in_app_iff.
      destruct (in_dec Nat.eq_dec i C) as [K|K]; [left; apply in_own; auto|right; apply in_rest; auto].
    + intros z. rewrite (fsum_scal own 0 z). ring.
    + intros x Hx _ p Hp. destruct (Own p Hp) as [[]|K]. apply K. exact Hx.
  - apply andb_prop in H as [H H2]. apply andb_prop in H2 as [H1 H2]. apply andb_prop in H as [H Hz].
    apply andb_prop in H as [Hv Hl]. apply Nat.leb_le in Hl. rewrite forallb_forall in Hz.
    destruct (Sub b0 (or_introl eq_refl)) as [Hb Ht]. set (v := snd (snd b0)) in *. set (t := fst b0) in *.
    apply negb_true_iff, Z.eqb_neq in Hv. unfold null_of in Hv, Hl, Hz. fold v in Hv, Hl, Hz. set (vz := map (scaled (dsv d)) v) in *.
    pose proof (sv_pos c Hgood b0 Hb) as Sp. fold d in Sp. set (vt := IZR (nth t vz 0%Z)).
    assert (Vt : vt <> 0) by (intros K; apply Hv; apply eq_IZR; exact K).
    set (nu := fun x : U.state => dot vz x / vt).
    assert (Ax : forall i, nu (axis i) = IZR (nth i vz 0%Z) / vt) by (intros i; unfold nu; rewrite dot_axis; reflexivity).
    assert (At : nu (axis t) = 1) by (rewrite Ax; unfold vt; field; exact Vt).
    assert (Np : forall x z, nu (U.plus x z) = nu x + nu z).
    { intros x z. unfold nu. change (U.plus x z) with (fun i => x i + z i). rewrite dot_plus. field. exact Vt. }
    assert (Nt : forall a x, nu (U.times a x) = a * nu x).
    { intros a x. unfold nu. change (U.times a x) with (fun i => a * x i). rewrite dot_scal. field. exact Vt. }
    assert (Off : forall i, ~ In i C -> nth i vz 0%Z = 0%Z).
    { intros i Hi. destruct (le_lt_dec n i) as [L|L]; [apply nth_overflow; lia|]. specialize (Hz i ltac:(apply in_seq; lia)).
      apply orb_prop in Hz as [K|K]; [apply mem_In in K; contradiction|apply Z.eqb_eq; exact K]. }
    assert (To : In t own) by (apply in_own; split; [apply Rn, HCR; exact Ht|exact Ht]).
    set (h := fun i => lap es (axis i) i).
    apply (enough_ok b (INR (length (filter (other t) own))) (Z.of_nat (length own) - 1) (bound u)); [|exact H1|exact H2|].
    { rewrite minus_IZR, <- INR_IZR_INZ, !length_fsum. rewrite (fsum_split t own _ own_once To). ring. }
    fold h. rewrite (fsum_split t own h own_once To). replace (h t) with (nu (axis t) * lap es (axis t) t) by (rewrite At; unfold h; ring).
    apply (trace_from nu t (other t) F b); auto.
    + intros x. pose proof (scaled_null c Hgood b0 (lap es x) Hb) as K. fold d v vz in K.
      pose proof (Hnull b0 Hb x) as Z. fold v in Z. unfold nu. rewrite K, Z. unfold Rdiv. ring.
    + intros x. rewrite Np, Nt, At. ring.
    + intros x i Hi. unfold axis. destruct (Nat.eqb_spec i t) as [E|E]; [|ring]. exfalso. rewrite E in Hi. destruct Hi as [Hi|Hi].
      * apply in_app_iff in Hi as [Hi|Hi].
        -- apply filter_In in Hi as [_ Hi]. unfold other in Hi. rewrite Nat.eqb_refl in Hi. discriminate.
        -- apply in_rest in Hi. tauto.
      * apply Hi. apply HCR. exact Ht.
    + intros z Hzs Hz0 Hi. assert (Ez : forall i, i <> t -> z i = 0).
      { intros i D. destruct (in_dec Nat.eq_dec i R) as [I|I]; [|apply Hzs; exact I]. apply Hi. apply in_app_iff.
        destruct (in_dec Nat.eq_dec i C) as [K|K].
        - left. apply filter_In. split; [apply in_own; auto|]. unfold other. destruct (Nat.eqb_spec i t); [contradiction|reflexivity].
        - right. apply in_rest. auto. }
      assert (Et : z = U.times (z t) (axis t)).
      { apply functional_extensionality. intros i. unfold U.times, axis. destruct (Nat.eqb_spec i t) as [->|D]; [ring|].
        rewrite (Ez i D). ring. }
      rewrite Et, Nt, At in Hz0. intros i. destruct (Nat.eq_dec i t) as [->|D]; [lra|apply Ez; exact D].
    + intros x Hx. unfold nu. rewrite dot_entries; [unfold Rdiv; ring|]. intros i.
      destruct (in_dec Nat.eq_dec i C) as [K|K]; [right; apply Hx; exact K|left; apply Off; exact K].
    + intros z. transitivity (fsum own (fun i => nu (axis i) * z i)); [|exact (fsum_split t own (fun i => nu (axis i) * z i) own_once To)].
      unfold own. rewrite fsum_filter.
      * unfold nu at 1. rewrite (dot_seq vz n z Hl). unfold Rdiv. rewrite Rmult_comm, <- fsum_scal. apply fsum_ext.
        intros i _. rewrite Ax. unfold Rdiv. ring.
      * intros i _ Hm. rewrite Ax, (Off i); [unfold Rdiv; ring|]. intros K. apply mem_In in K. congruence.
    + intros x Hx Hx0 p Hp. destruct (Own p Hp) as [[E|[]]|K]; [|apply K; exact Hx]. rewrite <- E. fold v.
      unfold nu in Hx0. assert (D : dot vz x = 0).
      { apply (Rmult_eq_reg_r (/ vt)); [|apply Rinv_neq_0_compat; exact Vt]. unfold Rdiv in Hx0. rewrite Hx0. ring. }
      pose proof (scaled_null c Hgood b0 x Hb) as K. fold d v vz in K. rewrite K in D. apply Rmult_integral in D as [D|D]; [lra|exact D].
Qed.
End Trace.
