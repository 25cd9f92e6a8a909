(** From the check to the upper bound on the rate: the span of the agents that a strong component reaches, on which
    its left null vector vanishes if it has one. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia Psatz Classical FunctionalExtensionality.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require UpperBound.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Margin.
Module U := UpperBound.
Open Scope R_scope.

Definition axis (i : nat) : U.state := fun j => if (j =? i)%nat then 1 else 0.
Definition supported (R : list nat) (x : U.state) : Prop := forall j, ~ In j R -> x j = 0.
Lemma dot_axis z : forall t, dot z (axis t) = IZR (nth t z 0%Z).
Proof.
  induction z as [|a z IH]; intros t; simpl; [destruct t; reflexivity|]. destruct t as [|t].
  - rewrite (dot_zero z) by (intros; unfold shift, axis; reflexivity). unfold axis. simpl. lra.
  - rewrite (dot_ext z _ (axis t)) by (intros; reflexivity). rewrite IH. unfold axis. simpl. lra.
Qed.
Lemma span_axes R : forall x, supported R x -> U.span (map axis R) x.
Proof.
  induction R as [|i R IH]; intros x H; simpl.
  - apply functional_extensionality. intros j. unfold U.times. rewrite (H j (fun A => A)). ring.
  - exists (fun j => if (j =? i)%nat then 0 else x j), (x i). split.
    + apply IH. intros j Hj. destruct (Nat.eqb_spec j i); [reflexivity|]. apply H. intros [E|E]; [congruence|contradiction].
    + apply functional_extensionality. intros j. unfold U.plus, U.times, axis. destruct (Nat.eqb_spec j i); [subst; ring|ring].
Qed.
Lemma axes_span R : forall x, U.span (map axis R) x -> supported R x.
Proof.
  induction R as [|i R IH]; intros x H j Hj; simpl in H.
  - subst x. unfold U.times. ring.
  - destruct H as [y [a [Hy ->]]]. unfold U.plus, U.times, axis. rewrite (IH y Hy j) by (intros A; apply Hj; right; exact A).
    destruct (Nat.eqb_spec j i); [exfalso; apply Hj; left; congruence|ring].
Qed.

(** * Forms *)
Definition nform (n : nat) (x y : U.state) : R := fold_right (fun i a => x i * y i + a) 0 (seq 0 n).
Lemma nform_form n : U.form (nform n).
Proof.
  split; intros; unfold nform; induction (seq 0 n) as [|i l IH]; simpl; try ring; rewrite IH; unfold U.plus, U.times; ring.
Qed.
Definition hform (A : mat) (x y : U.state) : R := bil A x y + bil A y x.
Lemma hform_form A : U.form (hform A).
Proof.
  split; intros; unfold hform; [ring| |].
  - change (U.plus x y) with (fun i => x i + y i). rewrite bil_plus_l, bil_plus_r. ring.
  - change (U.times c x) with (fun i => c * x i). rewrite bil_scal_l, bil_scal_r. ring.
Qed.
Lemma composed_form (B : U.state -> U.state -> R) (T : U.state -> U.state) : U.form B ->
  (forall x y, T (U.plus x y) = U.plus (T x) (T y)) -> (forall a x, T (U.times a x) = U.times a (T x)) ->
  U.form (fun x y => B (T x) (T y)).
Proof.
  intros HB Hp Ht. split; intros; cbn beta; rewrite ?Hp, ?Ht; [apply (U.sym B HB)|apply (U.add B HB)|apply (U.mul B HB)].
Qed.
Lemma size_pos l : 0 <= IZR (size l).
Proof. apply IZR_le. induction l as [|a l IH]; unfold size; simpl; [lia|]. fold (size l). lia. Qed.
Lemma squares_bound l : forall n x, (length l <= n)%nat -> - (IZR (size l) * norm2 n x) <= dot l (squares x).
Proof.
  induction l as [|a l IH]; intros n x H; simpl; [lra|]. fold (size l). destruct n as [|n]; [simpl in H; lia|].
  rewrite norm2_shift, plus_IZR, abs_IZR. specialize (IH n (shift x) ltac:(simpl in H; lia)).
  change (shift (squares x)) with (squares (shift x)). pose proof (norm2_pos n (shift x)) as P.
  pose proof (sq_pos (x 0%nat)) as Q. change (squares x 0%nat) with (sq (x 0%nat)).
  pose proof (size_pos l) as S0.
  assert (A0 : 0 <= Rabs (IZR a)) by apply Rabs_pos. pose proof (Rle_abs (- IZR a)) as A1. rewrite Rabs_Ropp in A1.
  assert (0 <= Rabs (IZR a) * norm2 n (shift x)) by (apply Rmult_le_pos; assumption).
  assert (0 <= IZR (size l) * sq (x 0%nat)) by (apply Rmult_le_pos; assumption).
  assert (- Rabs (IZR a) * sq (x 0%nat) <= IZR a * sq (x 0%nat)) by (apply Rmult_le_compat_r; lra). lra.
Qed.

(** * The Laplacian on a set of agents *)
Lemma lap_supported es R : (forall e, In e es -> In (src e) R -> In (tgt e) R) ->
  forall x, supported R x -> supported R (lap es x).
Proof.
  intros H x Hx i Hi. unfold lap. induction es as [|e es IH]; simpl; [reflexivity|].
  rewrite IH by (intros; apply H; [right|]; assumption). unfold lap_edge.
  destruct (Nat.eqb_spec (tgt e) i) as [E|E]; [|ring]. rewrite (Hx i Hi), (Hx (src e)); [ring|].
  intros A. apply Hi. rewrite <- E. apply H; [left; reflexivity|exact A].
Qed.
Lemma lap_agrees es (P : nat -> bool) x x' : (forall j, P j = true -> x j = x' j) ->
  (forall e, In e es -> P (tgt e) = true -> x (src e) = x' (src e)) -> forall i, P i = true -> lap es x i = lap es x' i.
Proof.
  intros HP H i Hi. unfold lap. induction es as [|e es IH]; simpl; [reflexivity|].
  rewrite IH by (intros; apply H; [right|]; assumption). f_equal. unfold lap_edge.
  destruct (Nat.eqb_spec (tgt e) i) as [E|E]; [|reflexivity].
  rewrite (HP i Hi), (H e (or_introl eq_refl) ltac:(rewrite E; exact Hi)). reflexivity.
Qed.

Section Upper.
Variables (c : cert) (u : upper).
Let d := prepare c.
Let n := order c.
Let es := edges c.
Hypothesis Hgood : forall p, In p (balanced_comps (comps c)) -> good (dsv d) (snd (snd p)) = true.
Hypothesis Hnull : forall p, In p (balanced_comps (comps c)) -> forall x, qdot (snd (snd p)) (lap es x) = 0.
Hypothesis Hkernel : forall x, (forall i, (i < n)%nat -> lap es x i = 0) -> forall i, (i < n)%nat -> x i = end_state c x i.
Hypothesis Htgt : forall e, In e es -> (tgt e < n)%nat.
Hypothesis Hrate : forall F x, fits n F = true -> 0 <= bil (rate_form (dls d) (dL d) F (bound u)) x x ->
  Q2R (bound u) * bil F x x <= bil F (lap es x) x + bil F x (lap es x).

(** a set [R], a linear function [nu] that [L] annihilates, an axis [t] along which it is projected to 0 *)
Lemma linear_form (F : U.state -> U.state -> Rdefinitions.R) : (forall x y, F x y = F y x) ->
  (forall a x y z, F (fun i => a * x i + y i) z = a * F x z + F y z) -> U.form F.
Proof.
  intros Fs Fl. assert (P : forall x y z, F (U.plus x y) z = F x z + F y z).
  { intros x y z. replace (U.plus x y) with (fun i => 1 * x i + y i) by (apply functional_extensionality; intros; unfold U.plus; ring).
    rewrite Fl. ring. }
  split; [exact Fs|exact P|]. intros a x z. pose proof (P (fun _ => 0) (fun _ => 0) z) as Z.
  replace (U.plus _ _) with (fun _ : nat => 0) in Z by (apply functional_extensionality; intros; unfold U.plus; ring).
  replace (U.times a x) with (fun i => a * x i + (fun _ => 0) i) by (apply functional_extensionality; intros; unfold U.times; ring).
  rewrite Fl. lra.
Qed.
Section Projected.
Variables (R : list nat) (nu : U.state -> Rdefinitions.R) (t : nat) (A : mat) (y : U.state).
Let T (x : U.state) : U.state := U.plus x (U.times (- nu x) (axis t)).
Hypothesis nu_plus : forall x z, nu (U.plus x z) = nu x + nu z.
Hypothesis nu_times : forall a x, nu (U.times a x) = a * nu x.
Hypothesis nu_lap : forall x, nu (lap es x) = 0.
Hypothesis nu_T : forall x, nu (T x) = 0.
Hypothesis R_T : forall x, supported R x -> supported R (T x).
Hypothesis R_lap : forall x, supported R x -> supported R (lap es x).
Hypothesis R_end : forall x, supported R x -> nu x = 0 -> forall i, end_state c x i = 0.
Hypothesis A_slack : (length (slack A) <= n)%nat.
Hypothesis A_rate : forall x, supported R x -> Q2R (bound u) * bil A x x <= bil A (lap es x) x + bil A x (lap es x).
Hypothesis y_R : supported R y.
Hypothesis y_nu : nu y = 0.
Hypothesis y_neg : bil A y y < 0.

Lemma T_plus x z : T (U.plus x z) = U.plus (T x) (T z).
Proof. unfold T. rewrite nu_plus. apply functional_extensionality. intros i. unfold U.plus, U.times. ring. Qed.
Lemma T_times a x : T (U.times a x) = U.times a (T x).
Proof. unfold T. rewrite nu_times. apply functional_extensionality. intros i. unfold U.plus, U.times. ring. Qed.
Lemma T_same x : nu x = 0 -> T x = x.
Proof. intros H. unfold T. rewrite H. apply functional_extensionality. intros i. unfold U.plus, U.times. ring. Qed.

Lemma projected : upper_claim c u.
Proof.
  intros F b Fs Fl F0 Fk Fb. pose proof (linear_form F Fs Fl) as HF.
  set (l := map axis R).
  apply (U.rate_limit l (fun x z => hform A (T x) (T z)) (fun x z => F (T x) (T z)) (fun x => lap es (T x)) y).
  - apply composed_form; [apply hform_form|apply T_plus|apply T_times].
  - apply composed_form; [exact HF|apply T_plus|apply T_times].
  - intros x _. apply F0.
  - destruct (U.coercive l (fun x z => F (T x) (T z)) (fun x z => nform n (T x) (T z))) as [e [He B]].
    + apply composed_form; [exact HF|apply T_plus|apply T_times].
    + apply composed_form; [apply nform_form|apply T_plus|apply T_times].
    + intros x _. apply F0.
    + intros x _. apply (norm2_pos n (T x)).
    + intros x Hx Z. apply axes_span in Hx. pose proof (Fk (T x) Z) as K. pose proof (Hkernel (T x) K) as E.
      unfold nform. assert (V : forall i, In i (seq 0 n) -> T x i = 0).
      { intros i Hi. apply in_seq in Hi. rewrite (E i ltac:(lia)). apply R_end; [apply R_T; exact Hx|apply nu_T]. }
      induction (seq 0 n) as [|i m IH]; simpl; [reflexivity|]. rewrite IH by (intros; apply V; right; assumption).
      rewrite (V i) by (left; reflexivity). ring.
    + set (s := IZR (size (slack A))). assert (S0 : 0 <= s) by apply size_pos.
      exists (s / e). split; [apply Rmult_le_pos; [exact S0|left; apply Rinv_0_lt_compat; exact He]|].
      intros x Hx. specialize (B x Hx). cbn beta in B. unfold hform.
      pose proof (slack_ok A (T x)) as K. pose proof (squares_bound (slack A) n (T x) A_slack) as K'. fold s in K'.
      change (norm2 n (T x)) with (nform n (T x) (T x)) in K'.
      assert (G : s * nform n (T x) (T x) <= s / e * F (T x) (T x)).
      { replace (s * nform n (T x) (T x)) with (s / e * (e * nform n (T x) (T x))) by (field; lra).
        apply Rmult_le_compat_l; [apply Rmult_le_pos; [exact S0|left; apply Rinv_0_lt_compat; exact He]|exact B]. }
      lra.
  - apply span_axes. exact y_R.
  - cbn beta. rewrite (T_same y y_nu). unfold hform. lra.
  - intros x Hx. apply span_axes, R_lap, R_T. apply axes_span. exact Hx.
  - intros x Hx. cbn beta. rewrite (T_same (lap es (T x)) (nu_lap (T x))). unfold hform.
    pose proof (A_rate (T x) (R_T x (axes_span R x Hx))) as K. lra.
  - intros x Hx. cbn beta. rewrite (T_same (lap es (T x)) (nu_lap (T x))). apply Fb.
Qed.
End Projected.

(** the left null vector as a linear function *)
Lemma dot_entries l : forall x, (forall i, nth i l 0%Z = 0%Z \/ x i = 0) -> dot l x = 0.
Proof.
  induction l as [|a l IH]; intros x H; simpl; [reflexivity|]. rewrite (IH (shift x)) by (intros i; apply (H (S i))).
  destruct (H 0%nat) as [E|E]; simpl in E; rewrite E; ring.
Qed.
Lemma end_zero x : (forall p, In p (balanced_comps (comps c)) -> qdot (snd (snd p)) x = 0) -> forall i, end_state c x i = 0.
Proof.
  unfold end_state. intros H i. revert H. generalize (balanced_comps (comps c)) as l. intros l H.
  induction l as [|p l IH]; simpl; [reflexivity|].
  rewrite IH by (intros; apply H; right; assumption). rewrite (H p) by (left; reflexivity). ring.
Qed.
Lemma scaled_null p x : In p (balanced_comps (comps c)) ->
  dot (map (scaled (dsv d)) (snd (snd p))) x = IZR (dsv d) * qdot (snd (snd p)) x.
Proof. intros Hp. apply dot_scaled. apply Hgood. exact Hp. Qed.
Lemma sv_pos p : In p (balanced_comps (comps c)) -> 0 < IZR (dsv d).
Proof. intros Hp. destruct (good_ok _ _ (Hgood p Hp)) as [P _]. apply IZR_lt. exact P. Qed.
Lemma null_outside R p : In p (balanced_comps (comps c)) ->
  forallb (fun i => (nth i (map (scaled (dsv d)) (snd (snd p))) 0 =? 0)%Z) R = true ->
  forall x, supported R x -> qdot (snd (snd p)) x = 0.
Proof.
  intros Hp H x Hx. rewrite forallb_forall in H. pose proof (scaled_null p x Hp) as E. rewrite dot_entries in E.
  - pose proof (sv_pos p Hp) as P. symmetry in E. apply Rmult_integral in E as [E|E]; [lra|exact E].
  - intros i. destruct (in_dec Nat.eq_dec i R) as [I|I]; [left; apply Z.eqb_eq; auto|right; apply Hx; exact I].
Qed.

Section Reached.
Variable C : list nat.
Let R := reach n es C.
Hypothesis Hregion : check_region c d C R = true.
Lemma region_parts :
  (forall a, In a es -> mem (tgt a) C = true -> mem (src a) C = true \/ ~ In (src a) R) /\
  (forall a, In a es -> In (src a) R -> In (tgt a) R) /\ (forall i, In i C -> In i R) /\ (forall i, In i R -> (i < n)%nat) /\
  (forall p, In p (balanced_comps (comps c)) ->
    In p (ends_of c C) \/ forall x, supported R x -> qdot (snd (snd p)) x = 0) /\
  (forall p, In p (ends_of c C) -> In p (balanced_comps (comps c)) /\ In (fst p) C).
Proof.
  pose proof Hregion as H. unfold check_region in H. fold es n in H.
  apply andb_prop in H as [H _]. apply andb_prop in H as [H Hz]. apply andb_prop in H as [H Hn].
  apply andb_prop in H as [H HCR]. apply andb_prop in H as [Hin Hout].
  rewrite forallb_forall in Hin, Hout, HCR, Hz, Hn. split; [|split; [|split; [|split; [|split]]]].
  - intros a Ha HC. specialize (Hin a Ha). rewrite HC in Hin. simpl in Hin. apply orb_prop in Hin as [K|K]; [left; exact K|right].
    intros A. apply mem_In in A. rewrite A in K. discriminate.
  - intros a Ha Hi. specialize (Hout a Ha). apply mem_In in Hi. rewrite Hi in Hout. apply mem_In. exact Hout.
  - intros i Hi. apply mem_In. auto.
  - intros i Hi. apply Nat.ltb_lt. auto.
  - intros p Hp. specialize (Hz p Hp). apply orb_prop in Hz as [Hz|Hz].
    + left. unfold ends_of. apply filter_In. split; [exact Hp|exact Hz].
    + right. apply null_outside; assumption.
  - intros p Hp. unfold ends_of in Hp. apply filter_In in Hp as [Hp HC]. split; [exact Hp|apply mem_In; exact HC].
Qed.

Lemma form_upper Hq yq : because u = ByForm Hq yq -> inside u = C -> check_form c d (bound u) C R Hq yq = true -> upper_claim c u.
Proof.
  intros _ _. unfold check_form. cbv zeta. fold n. set (off := filter (fun i => negb (mem i C)) (seq 0 n)).
  set (e := common (concat Hq)). set (A := map (map (scaled e)) Hq).
  set (yz := map (scaled (common yq)) yq). intros H.
  destruct region_parts as [Hin [RR [HCR [Rn [Own Sub]]]]].
  apply andb_prop in H as [H Hy]. apply andb_prop in H as [H Hyo].
  apply andb_prop in H as [H Hly]. apply andb_prop in H as [H He]. apply andb_prop in H as [H Hd].
  apply andb_prop in H as [H Hs]. apply andb_prop in H as [H Ho]. apply andb_prop in H as [_ Hfit].
  apply Nat.leb_le in Hs, Hly. apply Z.ltb_lt in Hy. rewrite forallb_forall in Hyo.
  set (y := vec_of yz).
  assert (Off : forall i, mem i off = true <-> ((i < n)%nat /\ mem i C = false)).
  { intros i. rewrite mem_In. unfold off. rewrite filter_In, in_seq, negb_true_iff. intuition lia. }
  assert (yR : supported R y).
  { intros i Hi. unfold y, vec_of. destruct (le_lt_dec n i) as [L|L].
    - rewrite nth_overflow by lia. reflexivity.
    - assert (M : In i off).
      { apply mem_In, Off. split; [exact L|]. destruct (mem i C) eqn:E; [|reflexivity]. exfalso. apply Hi.
        apply HCR. apply mem_In. exact E. }
      specialize (Hyo i M). apply Z.eqb_eq in Hyo. rewrite Hyo. reflexivity. }
  assert (yneg : bil A y y < 0).
  { unfold y. rewrite bil_vec_l, zdot_ok. apply IZR_lt. exact Hy. }
  assert (Arate : forall x, supported R x -> Q2R (bound u) * bil A x x <= bil A (lap es x) x + bil A x (lap es x)).
  { intros x Hx. set (x' := fun i => if mem i C then x i else 0).
    assert (E : forall i, mem i off = false -> x i = x' i).
    { intros i Hi. unfold x'. destruct (mem i C) eqn:EC; [reflexivity|]. apply Hx. intros K. pose proof (Rn i K) as L.
      assert (mem i off = true) by (apply Off; auto). congruence. }
    assert (EL : forall i, mem i off = false -> lap es x i = lap es x' i).
    { intros i Hi. apply (lap_agrees es (fun j => negb (mem j off))).
      - intros j Hj. apply E. apply negb_true_iff. exact Hj.
      - intros a Ha Ht. apply negb_true_iff in Ht. assert (TC : mem (tgt a) C = true).
        { destruct (mem (tgt a) C) eqn:EC; [reflexivity|]. assert (mem (tgt a) off = true) by (apply Off; auto). congruence. }
        unfold x'. destruct (mem (src a) C) eqn:SC; [reflexivity|].
        destruct (Hin a Ha TC) as [K|K]; [congruence|apply Hx; exact K].
      - rewrite Hi. reflexivity. }
    rewrite (outside_ok off A 0 x x' x x' Ho E E), (outside_ok off A 0 (lap es x) (lap es x') x x' Ho EL E),
      (outside_ok off A 0 x x' (lap es x) (lap es x') Ho E EL).
    apply Hrate; [exact Hfit|]. apply (definite_off_ok n off _ Hd). intros i Hi. apply Off in Hi as [_ Hi].
    unfold x'. rewrite Hi. reflexivity. }
  assert (Rlap : forall x, supported R x -> supported R (lap es x)) by (apply lap_supported; exact RR).
  revert He Own Sub. destruct (ends_of c C) as [|b [|b' l']]; intros He Own Sub; [| |discriminate].
  - apply (projected R (fun _ => 0) 0%nat A y).
    + intros; ring.
    + intros; ring.
    + reflexivity.
    + reflexivity.
    + intros x Hx j Hj. unfold U.plus, U.times. rewrite (Hx j Hj). ring.
    + exact Rlap.
    + intros x Hx _. apply end_zero. intros p Hp. destruct (Own p Hp) as [[]|K]; apply K; assumption.
    + exact Hs.
    + exact Arate.
    + exact yR.
    + reflexivity.
    + exact yneg.
  - assert (Hb : In b (balanced_comps (comps c))) by (apply (Sub b); left; reflexivity).
    assert (Ht : In (fst b) R) by (apply HCR; apply (Sub b); left; reflexivity).
    apply andb_prop in He as [Hv Hyb]. apply Z.eqb_eq in Hyb. unfold null_of in Hv, Hyb.
    apply negb_true_iff, Z.eqb_neq in Hv. set (v := snd (snd b)) in *. set (t := fst b) in *.
    pose proof (sv_pos b Hb) as Sp. set (vt := Q2R (nth t v 0%Q)).
    assert (Vt : vt <> 0).
    { intros K. apply Hv. apply eq_IZR. rewrite (nth_scaled (dsv d) v t (Hgood b Hb)). fold vt. rewrite K. ring. }
    assert (Ax : qdot v (axis t) = vt).
    { apply (Rmult_eq_reg_l (IZR (dsv d))); [|lra]. pose proof (scaled_null b (axis t) Hb) as E. fold v in E.
      rewrite <- E, dot_axis. apply (nth_scaled (dsv d) v t (Hgood b Hb)). }
    assert (Np : forall x z, qdot v (U.plus x z) / vt = qdot v x / vt + qdot v z / vt).
    { intros x z. change (U.plus x z) with (fun i => x i + z i). rewrite qdot_plus. field. exact Vt. }
    assert (Nt : forall a x, qdot v (U.times a x) / vt = a * (qdot v x / vt)).
    { intros a x. change (U.times a x) with (fun i => a * x i). rewrite qdot_scal. field. exact Vt. }
    apply (projected R (fun x => qdot v x / vt) t A y).
    + exact Np.
    + exact Nt.
    + intros x. pose proof (Hnull b Hb x) as E. fold v in E. rewrite E. unfold Rdiv. ring.
    + intros x. rewrite Np, Nt, Ax. field. exact Vt.
    + intros x Hx j Hj. unfold U.plus, U.times, axis. rewrite (Hx j Hj).
      destruct (Nat.eqb_spec j t) as [E|E]; [rewrite E in Hj; contradiction|ring].
    + exact Rlap.
    + intros x Hx Z. apply end_zero. intros p Hp. destruct (Own p Hp) as [[E|[]]|K]; [|apply K; exact Hx].
      rewrite <- E. fold v. apply (Rmult_eq_reg_r (/ vt)); [|apply Rinv_neq_0_compat; exact Vt]. unfold Rdiv in Z. rewrite Z. ring.
    + exact Hs.
    + exact Arate.
    + exact yR.
    + unfold y. apply (Rmult_eq_reg_l (IZR (dsv d) * vt)); [|apply Rmult_integral_contrapositive_currified; [lra|exact Vt]].
      transitivity (IZR (dsv d) * qdot v (vec_of yz)); [field; exact Vt|]. pose proof (scaled_null b (vec_of yz) Hb) as E. fold v in E.
      rewrite <- E, zdot_ok, Hyb. ring.
    + exact yneg.
Qed.
End Reached.
End Upper.
