(** Where agents come to rest, if [E] decays: the state has a limit, at which nothing moves; what the graph says of such
    states, and how final states are enclosed. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Mean Table Dominance Weighted.
Open Scope R_scope.

Lemma finite_choice {A} (a : A) n (P : nat -> A -> Prop) : (forall i, (i < n)%nat -> exists v, P i v) -> exists y, forall i, (i < n)%nat -> P i (y i).
Proof.
  induction n as [|n IH]; intros H; [exists (fun _ => a); intros; lia|].
  destruct (IH ltac:(intros; apply H; lia)) as [y Hy]. destruct (H n ltac:(lia)) as [v Hv].
  exists (fun i => if (i =? n)%nat then v else y i). intros i Hi. destruct (Nat.eqb_spec i n) as [->|N]; [exact Hv|apply Hy; lia].
Qed.
Lemma lap_minus es x y i : lap es (fun j => x j - y j) i = lap es x i - lap es y i.
Proof. unfold lap. induction es as [|e es IH]; simpl; [ring|]. rewrite IH. unfold lap_edge. destruct (tgt e =? i)%nat; ring. Qed.
Lemma abs_sq a b : 0 <= b -> sq a <= sq b -> Rabs a <= b.
Proof. unfold sq. intros Hb H. apply Rabs_le. split; nra. Qed.

(** * The limit *)
Section Limit.
Variables (n : nat) (es : list edge) (T rho1 k : R).
Hypotheses (HT : 0 < T) (H1 : 0 < rho1) (Hk : 0 < k).
Hypothesis Hr : forall e, In e es -> (tgt e < n)%nat /\ (src e < n)%nat.
Hypothesis Hbound : exists B, 0 <= B /\ forall x i, (i < n)%nat -> sq (lap es x i) <= B * norm2 n x.
Local Notation gain := (Certificate.gain T rho1 k).
Local Notation clock := (Certificate.clock T rho1 k).
Variables (X Sl : R -> nat -> R) (t0 : R).
Hypothesis HM : motion n (lap es) T rho1 k X Sl.
Hypothesis HQ : quiet n T Sl t0.
Variables (r C : R).
Hypotheses (Hr0 : 0 < r) (HC : 0 <= C).
Hypothesis HE : forall t i, t0 <= t < T -> (i < n)%nat -> sq (lap es (X t) i) <= sq C * exp (- (r * clock t)).
Let a (t : R) := exp (- (r / 2 * clock t)).
Let m := 2 * C / r.
Lemma a_sq t : sq (a t) = exp (- (r * clock t)).
Proof. unfold a, sq. rewrite <- exp_plus. f_equal. lra. Qed.
Lemma size t i : t0 <= t < T -> (i < n)%nat -> Rabs (lap es (X t) i) <= C * a t.
Proof.
  intros Ht Hi. apply abs_sq; [apply Rmult_le_pos; [exact HC|left; apply exp_pos]|].
  eapply Rle_trans; [apply HE; assumption|]. rewrite <- a_sq. unfold sq. right. ring.
Qed.
Lemma side (g : R) i t1 t2 : sq g = 1 -> (i < n)%nat -> t0 <= t1 <= t2 -> t2 < T -> g * X t2 i + m * a t2 <= g * X t1 i + m * a t1.
Proof.
  intros Hg Hi H12 H2. destruct HQ as [H0 _].
  assert (E : forall t, t0 <= t -> X (Rmax t0 t) i = X t i) by (intros t Ht; rewrite Rmax_right by exact Ht; reflexivity).
  rewrite <- (E t1), <- (E t2) by lra.
  assert (ad : forall t, t < T -> is_derive a t (- (r / 2) * gain t * a t)).
  { intros t Ht. unfold a. evar_last. { apply is_derive_comp; [apply is_derive_exp|]. apply @is_derive_opp.
      apply is_derive_scal. apply (clock_derive T rho1 k HT t Ht). }
    unfold scal, opp; simpl; unfold mult; simpl. ring. }
  apply (decreasing T t1 (fun t => g * X (Rmax t0 t) i + m * a t)
    (fun t => g * (- (gain t * lap es (X (Rmax t0 t)) i)) + m * (- (r / 2) * gain t * a t))); [| | |lra]; intros t Ht.
  - apply (is_derive_plus (fun t => g * X (Rmax t0 t) i) (fun t => m * a t)); apply @is_derive_scal.
    + apply (Y_derive n (lap es) T rho1 k X Sl t0 HM HQ t i); [lra|exact Hi].
    + apply ad. lra.
  - apply (continuous_plus (fun t => g * X (Rmax t0 t) i) (fun t => m * a t)).
    + apply (continuous_mult (fun _ => g)); [apply continuous_const|].
      apply (Y_cont n (lap es) T rho1 k X Sl t0 HM HQ t i); [lra|exact Hi].
    + apply (continuous_mult (fun _ => m)); [apply continuous_const|]. apply @ex_derive_continuous. eexists. apply ad. lra.
  - rewrite Rmax_right by lra. pose proof (size t i ltac:(lra) Hi) as S. pose proof (gain_pos T rho1 k H1 Hk t ltac:(lra)) as G.
    assert (Em : m * (- (r / 2) * gain t * a t) = - (C * a t * gain t)) by (unfold m; field; lra). rewrite Em.
    set (l := lap es (X t) i) in *. apply Rabs_le_between in S. unfold sq in Hg.
    assert (A : - (g * l) <= C * a t).
    { assert (D : g = 1 \/ g = -1) by (assert ((g - 1) * (g + 1) = 0) by lra; destruct (Rmult_integral _ _ H) as [Q|Q]; [left|right]; lra).
      destruct D as [-> | ->]; lra. }
    apply (Rmult_le_compat_r (gain t)) in A; [|lra]. lra.
Qed.
Lemma a_pos t : 0 < a t. Proof. apply exp_pos. Qed.
Lemma m_pos : 0 <= m.
Proof. unfold m. apply Rmult_le_pos; [lra|]. left. apply Rinv_0_lt_compat. exact Hr0. Qed.
Lemma limit_at i : (i < n)%nat -> exists v, forall t, t0 <= t < T -> Rabs (X t i - v) <= m * a t.
Proof.
  intros Hi. pose proof m_pos as M0. destruct HQ as [H0 _].
  assert (K : forall t t', t0 <= t < T -> t0 <= t' < T -> X t' i - m * a t' <= X t i + m * a t).
  { intros t t' Ht Ht'. pose proof (a_pos t) as A. pose proof (a_pos t') as A'.
    assert (P : 0 <= m * a t) by (apply Rmult_le_pos; lra). assert (P' : 0 <= m * a t') by (apply Rmult_le_pos; lra).
    destruct (Rle_dec t' t) as [L|L].
    - pose proof (side (-1) i t' t ltac:(unfold sq; ring) Hi ltac:(lra) ltac:(lra)). lra.
    - pose proof (side 1 i t t' ltac:(unfold sq; ring) Hi ltac:(lra) ltac:(lra)). lra. }
  destruct (completeness (fun v => exists t, t0 <= t < T /\ v = X t i - m * a t)) as [v [U L]].
  - exists (X t0 i + m * a t0). intros v [t [Ht ->]]. apply K; [lra|exact Ht].
  - exists (X t0 i - m * a t0), t0. split; [lra|reflexivity].
  - exists v. intros t Ht. apply Rabs_le. split.
    + assert (v <= X t i + m * a t); [|lra]. apply L. intros w [t' [Ht' ->]]. apply K; assumption.
    + assert (X t i - m * a t <= v); [|lra]. apply U. exists t. split; [exact Ht|reflexivity].
Qed.
Lemma vanishes (v : R) : (forall t, t0 <= t < T -> Rabs v <= m * a t) -> v = 0.
Proof.
  intros H. assert (L : filterlim (fun _ : R => v) (at_left T) (locally 0)).
  { apply (reaches n T rho1 k HT H1 Hk (fun _ _ => v) Sl t0 HQ 0%nat 0 (sq m) r Hr0 (sq_pos m)). intros t Ht. rewrite Rminus_0_r, <- a_sq.
    specialize (H t Ht). pose proof (a_pos t). pose proof m_pos. assert (0 <= m * a t) by (apply Rmult_le_pos; lra).
    apply Rabs_le_between in H. unfold sq. replace (m * m * (a t * a t)) with (m * a t * (m * a t)) by ring. nra. }
  apply (filterlim_locally_unique (F := at_left T) (fun _ : R => v)); [apply filterlim_const|exact L].
Qed.
Theorem comes_to_rest : exists y, (forall i, (i < n)%nat -> filterlim (fun t => X t i) (at_left T) (locally (y i))) /\
  (forall i, (i < n)%nat -> lap es y i = 0) /\ forall t i, t0 <= t < T -> (i < n)%nat -> Rabs (X t i - y i) <= m * a t.
Proof.
  destruct (finite_choice 0 n (fun i v => forall t, t0 <= t < T -> Rabs (X t i - v) <= m * a t) limit_at) as [y Hy].
  pose proof m_pos as M0.
  assert (Q : forall t i, t0 <= t < T -> (i < n)%nat -> sq (X t i - y i) <= sq m * exp (- (r * clock t))).
  { intros t i Ht Hi. rewrite <- a_sq. specialize (Hy i Hi t Ht). pose proof (a_pos t). apply Rabs_le_between in Hy.
    assert (0 <= m * a t) by (apply Rmult_le_pos; lra). unfold sq.
    replace (m * m * (a t * a t)) with (m * a t * (m * a t)) by ring. nra. }
  exists y. split; [|split; [|intros; apply Hy; assumption]].
  - intros i Hi. apply (reaches n T rho1 k HT H1 Hk X Sl t0 HQ i (y i) (sq m) r Hr0 (sq_pos m)). intros t Ht. apply Q; assumption.
  - intros i Hi. destruct Hbound as [B [B0 HB]].
    set (K := 2 * sq C + 2 * (B * (INR n * sq m))).
    assert (K0 : 0 <= K).
    { unfold K. pose proof (sq_pos C). pose proof (sq_pos m). pose proof (pos_INR n).
      assert (0 <= B * (INR n * sq m)) by (apply Rmult_le_pos; [lra|apply Rmult_le_pos; lra]). lra. }
    assert (L : filterlim (fun _ : R => lap es y i) (at_left T) (locally 0)).
    { apply (reaches n T rho1 k HT H1 Hk (fun _ _ => lap es y i) Sl t0 HQ i 0 K r Hr0 K0). intros t Ht. rewrite Rminus_0_r.
      pose proof (HB (fun j => X t j - y j) i Hi) as D. rewrite lap_minus in D. pose proof (HE t i Ht Hi) as E.
      assert (N : norm2 n (fun j => X t j - y j) <= INR n * (sq m * exp (- (r * clock t)))).
      { assert (G : forall l, (forall j, In j l -> (j < n)%nat) -> fsum l (fun j => sq (X t j - y j)) <= INR (length l) * (sq m * exp (- (r * clock t)))).
        { induction l as [|j l IH]; intros Hl; [simpl; lra|]. change (length (j :: l)) with (S (length l)). rewrite S_INR. simpl fsum.
          specialize (IH ltac:(intros; apply Hl; right; assumption)). pose proof (Q t j Ht (Hl j ltac:(left; reflexivity))). lra. }
        specialize (G (seq 0 n)). rewrite seq_length in G. apply G. intros j Hj. apply in_seq in Hj. lia. }
      apply (Rmult_le_compat_l _ _ _ B0) in N.
      set (e := exp (- (r * clock t))) in *. set (p := lap es (X t) i) in *. set (q := lap es y i) in *.
      pose proof (Rle_0_sqr (p + (p - q))) as S. unfold Rsqr in S. unfold K. unfold sq in *. nra. }
    apply (filterlim_locally_unique (F := at_left T) (fun _ : R => lap es y i)); [apply filterlim_const|exact L].
Qed.
End Limit.

(** * States at which nothing moves *)
Lemma terms_zero es f : (forall e, In e es -> 0 <= f e) -> esum es f = 0 -> forall e, In e es -> f e = 0.
Proof.
  assert (P : forall l, (forall e, In e l -> 0 <= f e) -> 0 <= esum l f).
  { induction l as [|e l IH]; intros H; simpl; [lra|]. specialize (IH ltac:(intros; apply H; right; assumption)).
    pose proof (H e ltac:(left; reflexivity)). lra. }
  induction es as [|e es IH]; intros H E g Hg; [destruct Hg|]. simpl in E.
  pose proof (H e ltac:(left; reflexivity)) as A. pose proof (P es ltac:(intros; apply H; right; assumption)) as B.
  destruct Hg as [<-|Hg]; [lra|]. apply IH; [intros; apply H; right; assumption|lra|exact Hg].
Qed.
Lemma lap_esum es x i : lap es x i = esum es (fun e => lap_edge i x e).
Proof. reflexivity. Qed.
Lemma esum_scal es a f : esum es (fun e => a * f e) = a * esum es f.
Proof. induction es as [|e es IH]; simpl; [ring|]. rewrite IH. ring. Qed.
Lemma esum_le es f g : (forall e, In e es -> f e <= g e) -> esum es f <= esum es g.
Proof.
  induction es as [|e es IH]; intros H; simpl; [lra|]. specialize (IH ltac:(intros; apply H; right; assumption)).
  pose proof (H e ltac:(left; reflexivity)). lra.
Qed.
Lemma side_of y : exists g, (g = 1 \/ g = -1) /\ g * y = Rabs y.
Proof. destruct (Rcase_abs y) as [N|N]; [exists (-1); rewrite (Rabs_left y N)|exists 1; rewrite (Rabs_right y N)]; split; auto; ring. Qed.

Section Still.
Variables (n : nat) (es : list edge) (y : nat -> R).
Hypothesis Hr : forall e, In e es -> (tgt e < n)%nat /\ (src e < n)%nat.
Hypothesis Hnz : forall e, In e es -> Q2R (wt e) <> 0.
Variables (S : nat -> Prop) (m : R).
Hypothesis Hy : forall i, (i < n)%nat -> S i -> lap es y i = 0.
Hypothesis HS : forall e, In e es -> S (tgt e) -> S (src e).
Hypothesis Hm : forall i, S i -> Rabs (y i) <= m.
Lemma edge_rule e : In e es -> S (tgt e) -> Rabs (y (tgt e)) = m -> Q2R (wt e) * y (src e) = Rabs (Q2R (wt e)) * y (tgt e).
Proof.
  intros He HT E. destruct (Hr e He) as [Rt _]. set (t := tgt e) in *. destruct (side_of (y t)) as [g [G1 G2]].
  assert (Z : g * lap_edge t y e = 0).
  { apply (terms_zero es (fun e => g * lap_edge t y e)); [| |exact He].
    - intros f Hf. unfold lap_edge. destruct (Nat.eqb_spec (tgt f) t) as [T|_]; [|lra].
      assert (B : Rabs (y (src f)) <= m) by (apply Hm; apply HS; [exact Hf|rewrite T; exact HT]).
      replace (g * (Rabs (Q2R (wt f)) * y t - Q2R (wt f) * y (src f)))
        with (Rabs (Q2R (wt f)) * (g * y t) - g * (Q2R (wt f) * y (src f))) by ring.
      rewrite G2, E. assert (A : g * (Q2R (wt f) * y (src f)) <= Rabs (Q2R (wt f)) * Rabs (y (src f))).
      { rewrite <- Rabs_mult. set (v := Q2R (wt f) * y (src f)). pose proof (Rle_abs v). pose proof (Rle_abs (- v)) as V.
        rewrite Rabs_Ropp in V. destruct G1 as [-> | ->]; lra. }
      pose proof (Rabs_pos (Q2R (wt f))). nra.
    - rewrite esum_scal, <- lap_esum, Hy by assumption. ring. }
  unfold lap_edge in Z. fold t in Z. rewrite Nat.eqb_refl in Z. destruct G1 as [-> | ->]; lra.
Qed.
Lemma edge_same e : In e es -> S (tgt e) -> Rabs (y (tgt e)) = m -> Rabs (y (src e)) = m.
Proof.
  intros He HT E. pose proof (edge_rule e He HT E) as R. apply (f_equal Rabs) in R. rewrite !Rabs_mult, Rabs_Rabsolu, E in R.
  apply Rmult_eq_reg_l in R; [exact R|]. apply Rabs_no_R0. apply Hnz. exact He.
Qed.
Lemma path_same a b : path es a b -> S b -> Rabs (y b) = m -> Rabs (y a) = m.
Proof. intros P. induction P as [i|i e He P IH]; intros HT E; [exact E|]. apply IH; [apply HS; assumption|apply edge_same; assumption]. Qed.
End Still.
Lemma largest_of (f : nat -> R) C : C <> [] -> exists b, In b C /\ forall i, In i C -> f i <= f b.
Proof.
  induction C as [|a C IH]; intros H; [contradiction|]. destruct C as [|a' C].
  - exists a. split; [left; reflexivity|]. intros i [<-|[]]. lra.
  - destruct (IH ltac:(discriminate)) as [b [Hb M]]. destruct (Rle_dec (f a) (f b)) as [L|L].
    + exists b. split; [right; exact Hb|]. intros i [<-|Hi]; [exact L|apply M; exact Hi].
    + exists a. split; [left; reflexivity|]. intros i [<-|Hi]; [lra|]. specialize (M i Hi). lra.
Qed.

Section Graph.
Variable c : cert.
Let es := edges c.
Let n := order c.
Hypothesis Hr : forall e, In e es -> (tgt e < n)%nat /\ (src e < n)%nat.
Hypothesis Hnz : forall e, In e es -> Q2R (wt e) <> 0.
Hypothesis Hs : structure c.
Hypothesis Hc : claims c.
Hypothesis Hin : forall C i, In C (comps c) -> In i (nodes C) -> (i < n)%nat.
Hypothesis Hreach : forall i, (i < n)%nat -> exists C, In C (comps c) /\ nodes C <> [] /\ path es (hd O (nodes C)) i.
Variable y : nat -> R.
Hypothesis Hy : forall i, (i < n)%nat -> lap es y i = 0.

Lemma comp_same C : In C (comps c) -> exists m, forall i, In i (nodes C) -> Rabs (y i) = m.
Proof.
  intros HC. destruct Hs as [A _]. destruct (A C HC) as [[i0 H0] [Cl St]].
  destruct (largest_of (fun i => Rabs (y i)) (nodes C)) as [b [Hb M]]; [intros E; rewrite E in H0; destruct H0|].
  exists (Rabs (y b)). intros i Hi.
  apply (path_same n es y Hr Hnz (fun i => In i (nodes C)) (Rabs (y b)) (fun i Hi _ => Hy i Hi) Cl M i b); auto.
Qed.
Lemma comp_edge C e : In C (comps c) -> In e es -> In (tgt e) (nodes C) ->
  Q2R (wt e) * y (src e) = Rabs (Q2R (wt e)) * y (tgt e).
Proof.
  intros HC He Ht. destruct (comp_same C HC) as [m M]. destruct Hs as [A _]. destruct (A C HC) as [_ [Cl _]].
  apply (edge_rule n es y Hr (fun i => In i (nodes C)) m (fun i Hi _ => Hy i Hi) Cl); auto. intros i Hi. rewrite (M i Hi). lra.
Qed.
Lemma sign_product q a b : (0 < q * inject_Z (a * b))%Q -> 0 < Q2R q * (IZR a * IZR b).
Proof.
  intros H. apply Qlt_Rlt in H. rewrite Q2R_mult in H. replace (Q2R 0) with 0 in H by (unfold Q2R; simpl; lra).
  unfold Q2R at 2 in H. simpl in H. rewrite mult_IZR in H. lra.
Qed.
Lemma comp_camps C g : In C (comps c) -> camps C = Gauge g -> forall i, In i (nodes C) ->
  y i = sgn g i * (sgn g (hd O (nodes C)) * y (hd O (nodes C))).
Proof.
  intros HC E i Hi. destruct Hs as [A [_ B]]. destruct (A C HC) as [_ [Cl St]]. specialize (B C HC). rewrite E in B.
  destruct B as [B1 B2].
  assert (Sq : forall j, In j (nodes C) -> sgn g j * sgn g j = 1).
  { intros j Hj. unfold sgn. destruct (B1 j Hj) as [-> | ->]; lra. }
  assert (G : forall a b, path es a b -> In b (nodes C) -> sgn g a * y a = sgn g b * y b).
  { intros a b P. induction P as [j|j e He P IH]; intros Hj; [reflexivity|].
    assert (Hse : In (src e) (nodes C)) by (apply Cl; assumption). rewrite (IH Hse).
    pose proof (comp_edge C e HC He Hj) as R. specialize (B2 e He Hse Hj). apply sign_product in B2. fold (sgn g (tgt e)) (sgn g (src e)) in B2.
    change (IZR (nth (tgt e) g 0%Z)) with (sgn g (tgt e)) in B2. change (IZR (nth (src e) g 0%Z)) with (sgn g (src e)) in B2.
    pose proof (Sq _ Hse) as S1. pose proof (Sq _ Hj) as S2. set (s1 := sgn g (src e)) in *. set (s2 := sgn g (tgt e)) in *.
    set (w := Q2R (wt e)) in *.
    assert (W : Rabs w = w * (s2 * s1)).
    { assert (D1 : s1 = 1 \/ s1 = -1) by (assert (Q : (s1 - 1) * (s1 + 1) = 0) by lra; destruct (Rmult_integral _ _ Q); [left|right]; lra).
      assert (D2 : s2 = 1 \/ s2 = -1) by (assert (Q : (s2 - 1) * (s2 + 1) = 0) by lra; destruct (Rmult_integral _ _ Q); [left|right]; lra).
      destruct D1 as [-> | ->], D2 as [-> | ->]; [rewrite Rabs_right by lra|rewrite Rabs_left by lra|rewrite Rabs_left by lra|rewrite Rabs_right by lra]; lra. }
    rewrite W in R. assert (R' : y (src e) = s2 * s1 * y (tgt e)).
    { apply (Rmult_eq_reg_l w); [lra|]. apply Hnz. exact He. }
    rewrite R'. transitivity (s1 * s1 * (s2 * y (tgt e))); [ring|]. rewrite S1. ring. }
  assert (Hh : In (hd O (nodes C)) (nodes C)) by (destruct (nodes C); [destruct Hi|left; reflexivity]).
  rewrite <- (G i (hd O (nodes C)) (St i _ Hi Hh) Hh). transitivity (sgn g i * sgn g i * y i); [rewrite (Sq i Hi); ring|ring].
Qed.
Lemma comp_zero C cy : In C (comps c) -> camps C = Cycle cy -> forall i, In i (nodes C) -> y i = 0.
Proof.
  intros HC E i Hi. destruct (comp_same C HC) as [m M]. destruct Hs as [A [_ B]]. destruct (A C HC) as [_ [Cl St]].
  specialize (B C HC). rewrite E in B. simpl in B. pose proof (M i Hi) as Mi. destruct (Req_dec m 0) as [Z|NZ].
  - rewrite Z in Mi. destruct (Req_dec (y i) 0) as [Y|Y]; [exact Y|]. apply Rabs_no_R0 in Y. contradiction.
  - exfalso. apply (B (fun j => if Rlt_dec 0 (y j) then 1%Z else (-1)%Z)). split.
    + intros j _. destruct (Rlt_dec 0 (y j)); auto.
    + intros e He Hse Ht. apply Rlt_Qlt. rewrite Q2R_mult. replace (Q2R 0) with 0 by (unfold Q2R; simpl; lra).
      unfold Q2R at 2. simpl. pose proof (comp_edge C e HC He Ht) as R. pose proof (M _ Hse) as M1. pose proof (M _ Ht) as M2.
      pose proof (Rabs_pos (y (tgt e))) as P. assert (m > 0) by lra. clear P.
      pose proof (Hnz e He) as W. set (w := Q2R (wt e)) in *. set (a := y (src e)) in *. set (b := y (tgt e)) in *.
      assert (W0 : 0 < Rabs w) by (apply Rabs_pos_lt; exact W).
      destruct (Rlt_dec 0 a) as [La|La], (Rlt_dec 0 b) as [Lb|Lb]; simpl.
      * rewrite (Rabs_right a), (Rabs_right b) in * by lra. nra.
      * assert (Lb' : b < 0) by (destruct (Req_dec b 0) as [Q|Q]; [rewrite Q, Rabs_R0 in M2; lra|lra]). nra.
      * assert (La' : a < 0) by (destruct (Req_dec a 0) as [Q|Q]; [rewrite Q, Rabs_R0 in M1; lra|lra]). nra.
      * assert (La' : a < 0) by (destruct (Req_dec a 0) as [Q|Q]; [rewrite Q, Rabs_R0 in M1; lra|lra]).
        assert (Lb' : b < 0) by (destruct (Req_dec b 0) as [Q|Q]; [rewrite Q, Rabs_R0 in M2; lra|lra]). nra.
Qed.
Theorem rests_ok : at_rest c y.
Proof.
  split; [exact Hy|]. split.
  - intros C i HC Hi h. destruct (camps C) as [g|cy] eqn:E.
    + apply (comp_camps C g HC E i Hi).
    + apply (comp_zero C cy HC E i Hi).
  - intros P M i HP Hi Hn HM HB. destruct Hc as [HP' _]. destruct (HP' P HP) as [L _]. fold es in L.
    destruct (largest_of (fun i => Rabs (y i)) (filter (fun j => (j <? n)%nat) (members P))) as [b [Hb MB]].
    { intros E. assert (In i (filter (fun j => (j <? n)%nat) (members P))) by (apply filter_In; split; [exact Hi|apply Nat.ltb_lt; exact Hn]).
      rewrite E in H. destruct H. }
    apply filter_In in Hb as [Hb Hbn]. apply Nat.ltb_lt in Hbn.
    assert (Li : Rabs (y i) <= Rabs (y b)) by (apply MB; apply filter_In; split; [exact Hi|apply Nat.ltb_lt; exact Hn]).
    destruct (Hreach b Hbn) as [C [HC [Ne HP2]]].
    assert (Back : forall e, In e es -> In (tgt e) (members P) /\ (tgt e < n)%nat -> In (src e) (members P) /\ (src e < n)%nat).
    { intros e He [Ht _]. destruct (Hr e He) as [_ Rs]. split; [|exact Rs]. apply (L (tgt e) (src e) Ht).
      apply (path_step _ _ (swap e)); [apply in_app_iff; right; apply in_map; exact He|]. constructor. }
    assert (Bd : forall j, In j (members P) /\ (j < n)%nat -> Rabs (y j) <= Rabs (y b)).
    { intros j [Hj Hjn]. apply MB. apply filter_In. split; [exact Hj|apply Nat.ltb_lt; exact Hjn]. }
    pose proof (path_same n es y Hr Hnz (fun j => In j (members P) /\ (j < n)%nat) (Rabs (y b)) (fun j Hj _ => Hy j Hj) Back Bd _ b HP2 (Logic.conj Hb Hbn) eq_refl) as Eh.
    assert (Hh : In (hd O (nodes C)) (members P)).
    { pose proof (closed_path es (fun j => In j (members P) /\ (j < n)%nat) (hd O (nodes C)) b Back HP2 (Logic.conj Hb Hbn)) as K. apply K. }
    assert (Ho : In C (own c P)) by (unfold own; apply filter_In; split; [exact HC|apply mem_In; exact Hh]).
    eapply Rle_trans; [exact Li|]. rewrite <- Eh. destruct (is_balanced C) eqn:E; [apply HB; assumption|].
    unfold is_balanced in E. destruct (camps C) as [g|cy] eqn:E'; [discriminate|].
    rewrite (comp_zero C cy HC E'); [rewrite Rabs_R0; exact HM|]. destruct (nodes C); [contradiction|left; reflexivity].
Qed.
End Graph.
