(** What the input takes from the initial state: integrals along a motion, from what falls at least as fast. *)
Require Import ZArith QArith Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input.
Open Scope R_scope.

(** * Exponentials *)
Lemma Q2R_inject z : Q2R (inject_Z z) = IZR z.
Proof. unfold Q2R. simpl. field. Qed.
Lemma horner_sum p : forall m j : nat, Q2R (horner p j m) * (Q2R p ^ j / INR (fact j))
  + match j with O => 0 | S j' => sum_f_R0 (fun i => Q2R p ^ i / INR (fact i)) j' end
  = sum_f_R0 (fun i => Q2R p ^ i / INR (fact i)) (j + m).
Proof.
  induction m as [|m IH]; intros j; cbn [horner].
  - rewrite Nat.add_0_r, RMicromega.Q2R_1. destruct j as [|j]; [simpl; lra|]. rewrite tech5. ring.
  - replace (j + S m)%nat with (S j + m)%nat by lia. rewrite <- IH. rewrite Q2R_plus, RMicromega.Q2R_1, Q2R_mult.
    assert (N0 : INR (fact j) <> 0) by apply INR_fact_neq_0.
    assert (N1 : IZR (Z.of_nat (S j)) <> 0) by (apply IZR_neq; lia).
    assert (E : Q2R (p / inject_Z (Z.of_nat (S j))) = Q2R p / IZR (Z.of_nat (S j))).
    { rewrite Q2R_div by (unfold Qeq; simpl; lia). rewrite Q2R_inject. reflexivity. }
    rewrite E. set (h := Q2R (horner p (S j) m)).
    assert (F : INR (fact (S j)) = IZR (Z.of_nat (S j)) * INR (fact j)) by (rewrite fact_simpl, mult_INR, (INR_IZR_INZ (S j)); reflexivity).
    assert (K : (1 + Q2R p / IZR (Z.of_nat (S j)) * h) * (Q2R p ^ j / INR (fact j))
      = h * (Q2R p ^ S j / INR (fact (S j))) + Q2R p ^ j / INR (fact j)) by (rewrite F; simpl pow; field; split; assumption).
    rewrite K. destruct j as [|j].
    + cbn [sum_f_R0]. apply Rplus_eq_reg_r with 0. rewrite !Rplus_0_r. reflexivity.
    + rewrite (tech5 _ j). ring.
Qed.
Lemma horner_ok p m : 0 <= Q2R p -> 1 <= Q2R (horner p 0 m) <= exp (Q2R p).
Proof.
  intros H. assert (P : forall m j, 1 <= Q2R (horner p j m)).
  { clear m. induction m as [|m IH]; intros j; cbn [horner]; [rewrite RMicromega.Q2R_1; lra|].
    rewrite Q2R_plus, RMicromega.Q2R_1, Q2R_mult, Q2R_div by (unfold Qeq; simpl; lia).
    assert (N1 : 0 < Q2R (inject_Z (Z.of_nat (S j)))).
    { rewrite Q2R_inject. apply IZR_lt. lia. }
    assert (0 <= Q2R p / Q2R (inject_Z (Z.of_nat (S j)))) by (apply Rmult_le_pos; [assumption|left; apply Rinv_0_lt_compat; assumption]).
    specialize (IH (S j)). nra. }
  split; [apply P|]. pose proof (horner_sum p m 0) as E. simpl in E. eapply Rle_trans; [|apply (exp_ge_taylor _ m H)].
  rewrite <- E. lra.
Qed.

(** * A form at the begin *)
Lemma value_ok n F f l x0 : (0 < f)%Z -> fits n F = true -> good (common l) l = true ->
  (forall i, (i < n)%nat -> x0 i = Q2R (nth i l 0%Q)) -> Q2R (value F f l) = bil F x0 x0 / IZR f.
Proof.
  intros Hf HF G H0. destruct (fits_ok _ _ HF) as [A B]. destruct (good_ok _ _ G) as [E0 _]. unfold value.
  set (e := common l) in *. set (z := map (scaled e) l).
  assert (Z : forall i, (i < n)%nat -> vec_of z i = IZR e * x0 i).
  { intros i Hi. rewrite H0 by assumption. apply nth_scaled. exact G. }
  rewrite Q2R_div, !Q2R_inject by (unfold Qeq; cbn [Qnum Qden inject_Z]; nia).
  rewrite <- zdot_ok, <- bil_vec_l.
  rewrite (bil_ext_l F (vec_of z) (fun i => IZR e * x0 i)) by (intros; apply Z; lia).
  rewrite (bil_ext_r F n _ (vec_of z) (fun i => IZR e * x0 i) B) by (intros; apply Z; assumption).
  rewrite bil_scal_l, bil_scal_r, !mult_IZR. apply IZR_lt in Hf, E0. field. lra.
Qed.

(** * The integral of what is less than the decrease of something that stays positive *)
Lemma integral_below (T : R) (g F dF : R -> R) : 0 < T -> (forall u, u < T -> continuous g u) ->
  (forall u, 0 < u < T -> is_derive F u (dF u)) -> (forall u, 0 <= u < T -> continuous F u) ->
  (forall u, 0 <= u < T -> g u <= - dF u) -> (forall u, 0 <= u < T -> 0 <= F u) ->
  forall t, 0 <= t < T -> ex_RInt g 0 t /\ RInt g 0 t <= F 0.
Proof.
  intros HT Cg DF CF L P t Ht.
  assert (E : forall u, u < T -> ex_RInt g 0 u).
  { intros u Hu. apply (ex_RInt_continuous (V := R_CompleteNormedModule)). intros z Hz. apply Cg. pose proof (Rmax_lub_lt 0 u T HT Hu). lra. }
  split; [apply E; lra|].
  assert (D : forall u, u < T -> is_derive (fun u => RInt g 0 u) u (g u)).
  { intros u Hu. apply (is_derive_RInt g (fun u => RInt g 0 u) 0 u); [|apply Cg; assumption].
    assert (He : 0 < T - u) by lra. exists (mkposreal _ He). intros v Hv. apply (RInt_correct (V := R_CompleteNormedModule)), E.
    unfold ball in Hv; simpl in Hv; unfold AbsRing_ball, abs, minus, plus, opp in Hv; simpl in Hv. apply Rabs_def2 in Hv. lra. }
  pose proof (decreasing T 0 (fun u => RInt g 0 u + F u) (fun u => g u + dF u)) as K.
  specialize (P t Ht). assert (Z : RInt g 0 0 = 0) by (rewrite RInt_point; reflexivity). cbv beta in K. rewrite Z in K.
  enough (RInt g 0 t + F t <= 0 + F 0) by lra. apply K; [| | |assumption]; clear t Ht P; intros t Ht.
  - apply (is_derive_plus (fun u => RInt g 0 u) F); [apply D; lra|apply DF; assumption].
  - apply (continuous_plus (fun u => RInt g 0 u) F); [|apply CF; assumption].
    apply @ex_derive_continuous. exists (g t). apply D. lra.
  - specialize (L t Ht). lra.
Qed.

(** * The gain against the clock: [gain <= rho1 + k/T (p + e^(s/k - p))] *)
Lemma gain_above T rho1 k p t : 0 < T -> 0 < rho1 -> 0 < k -> 0 <= p -> p * k <= rho1 * T -> 0 <= t < T ->
  gain T rho1 k t <= rho1 + k / T * p + k / T * (exp (- p) * exp (/ k * clock T rho1 k t)).
Proof.
  intros HT H1 Hk Hp Hq Ht. unfold gain, clock. set (q := rho1 * T / k). set (w := (T - t) / T).
  assert (Hw : 0 < w) by (apply Rdiv_lt_0_compat; lra).
  assert (W1 : T / (T - t) = / w) by (unfold w; field; lra). rewrite W1.
  assert (E : / k * (rho1 * t + k * ln (/ w)) = q * (1 - w) + ln (/ w)) by (unfold q, w; field; lra).
  rewrite E, exp_plus, exp_ln by (apply Rinv_0_lt_compat; assumption).
  replace (k / (T - t)) with (k / T * / w) by (unfold w; field; lra).
  assert (K : 0 < k / T) by (apply Rdiv_lt_0_compat; assumption).
  enough (/ w <= p + exp (- p) * (exp (q * (1 - w)) * / w)) by nra.
  rewrite <- Rmult_assoc, <- exp_plus. set (y := - p + q * (1 - w)).
  pose proof (exp_ineq1_le y) as Y.
  assert (Q : p <= q) by (unfold q; apply (Rmult_le_reg_r k); [assumption|]; unfold Rdiv; rewrite Rmult_assoc, Rinv_l; lra).
  assert (W2 : w <= 1) by (unfold w; apply (Rmult_le_reg_r T); [assumption|]; unfold Rdiv; rewrite Rmult_assoc, Rinv_l; lra).
  apply (Rmult_le_reg_r w); [assumption|].
  replace ((p + exp y * / w) * w) with (p * w + exp y) by (field; lra). rewrite Rinv_l by lra.
  assert (0 <= (q - p) * (1 - w)) by (apply Rmult_le_pos; lra). unfold y in *. lra.
Qed.

(** * Along a motion *)
Lemma continuous_norm2 n (f : R -> nat -> R) t : (forall i, (i < n)%nat -> continuous (fun u => f u i) t) ->
  continuous (fun u => norm2 n (f u)) t.
Proof.
  intros H. unfold norm2. assert (K : forall i, In i (seq 0 n) -> continuous (fun u => f u i) t) by (intros i Hi; apply in_seq in Hi; apply H; lia).
  induction (seq 0 n) as [|i l IH]; simpl; [apply continuous_const|].
  apply (continuous_plus (fun u => sq (f u i)) (fun u => fold_right (fun i a => sq (f u i) + a) 0 l)).
  - apply (continuous_mult (fun u => f u i) (fun u => f u i)); apply K; left; reflexivity.
  - apply IH. intros j Hj. apply K. right. assumption.
Qed.
Lemma continuous_lap es n (f : R -> nat -> R) t i : (forall e, In e es -> (src e < n)%nat) -> (i < n)%nat ->
  (forall j, (j < n)%nat -> continuous (fun u => f u j) t) -> continuous (fun u => lap es (f u) i) t.
Proof.
  intros Hs Hi H. unfold lap. induction es as [|e es IH]; simpl; [apply continuous_const|].
  apply (continuous_plus (fun u => lap_edge i (f u) e) (fun u => fold_right (fun e a => lap_edge i (f u) e + a) 0 es)).
  - unfold lap_edge. destruct (tgt e =? i)%nat; [|apply continuous_const].
    apply (continuous_minus (fun u => Rabs (Q2R (wt e)) * f u i) (fun u => Q2R (wt e) * f u (src e))).
    + apply (continuous_mult (fun _ => Rabs (Q2R (wt e))) (fun u => f u i)); [apply continuous_const|apply H; assumption].
    + apply (continuous_mult (fun _ => Q2R (wt e)) (fun u => f u (src e))); [apply continuous_const|apply H, Hs; left; reflexivity].
  - apply IH. intros e' He. apply Hs. right. assumption.
Qed.
Lemma norm2_scal n a x : norm2 n (fun i => - (a * x i)) = sq a * norm2 n x.
Proof. unfold norm2, sq. induction (seq 0 n) as [|i l IH]; simpl; [ring|]. rewrite IH. ring. Qed.

Section Continuous.
Variables (c : cert) (X S : R -> nat -> R).
Let n := order c.
Let es := edges c.
Let T := deadline c.
Hypothesis Hsrc : forall e, In e es -> (src e < n)%nat.
Hypothesis HM : moves c X S.
Let Y (u : R) : nat -> R := X (Rmax 0 u).
Lemma Y_all t i : t < T -> (i < n)%nat -> continuous (fun u => Y u i) t.
Proof. intros Ht Hi. destruct HM as [[_ C] _]. apply C; assumption. Qed.
Lemma input_cont t i : t < T -> (i < n)%nat -> continuous (fun u => input c Y u i) t.
Proof.
  intros Ht Hi. unfold input.
  apply (continuous_opp (fun u => gain (deadline c) (Q2R (rho1 c)) (k c) u * lap (edges c) (Y u) i)).
  apply (continuous_mult (fun u => gain (deadline c) (Q2R (rho1 c)) (k c) u) (fun u => lap (edges c) (Y u) i)).
  - apply @ex_derive_continuous. unfold gain. fold T. auto_derive. lra.
  - apply (continuous_lap es n); auto. intros. apply Y_all; assumption.
Qed.
Lemma power_cont t : t < T -> continuous (fun u => norm2 n (input c Y u)) t.
Proof. intros. apply continuous_norm2. intros. apply input_cont; assumption. Qed.
Lemma power_eq u : 0 <= u -> norm2 n (input c Y u) = sq (gain T (Q2R (rho1 c)) (k c) u) * norm2 n (lap es (X u)).
Proof. intros. unfold input. rewrite norm2_scal. unfold Y. rewrite Rmax_right by assumption. reflexivity. Qed.
(** the same with the state itself, whose values left of 0 do not matter *)
Lemma back (g : R -> R) t b : 0 <= t -> ex_RInt (fun u => g (norm2 n (input c Y u))) 0 t /\ RInt (fun u => g (norm2 n (input c Y u))) 0 t <= b ->
  ex_RInt (fun u => g (norm2 n (input c X u))) 0 t /\ RInt (fun u => g (norm2 n (input c X u))) 0 t <= b.
Proof.
  intros Ht [E L]. assert (K : forall u, Rmin 0 t < u < Rmax 0 t -> g (norm2 n (input c Y u)) = g (norm2 n (input c X u))).
  { intros u Hu. rewrite Rmin_left in Hu by assumption. unfold input, Y. rewrite Rmax_right by lra. reflexivity. }
  split; [exact (ex_RInt_ext _ _ _ _ K E)|]. rewrite <- (RInt_ext _ _ _ _ K). exact L.
Qed.
End Continuous.

Section Along.
Variables (c : cert) (X S : R -> nat -> R).
Let n := order c.
Let es := edges c.
Let T := deadline c.
Hypotheses (HT : 0 < T) (H1 : 0 < Q2R (rho1 c)) (Hk : 0 < k c).
Hypothesis Hsrc : forall e, In e es -> (src e < n)%nat.
Hypothesis HX : moves_from c X S 0.
Let Y (u : R) : nat -> R := X (Rmax 0 u).
Lemma s_0 : s c 0 = 0. Proof. apply clock_0. exact HT. Qed.

Lemma path_length (r b : R) : 0 < r -> 0 <= b ->
  (forall t, 0 <= t < T -> norm2 n (lap es (X t)) <= exp (- (r * s c t)) * sq (r / 2 * b)) ->
  forall t, 0 <= t < T -> ex_RInt (fun u => sqrt (norm2 n (input c X u))) 0 t /\ RInt (fun u => sqrt (norm2 n (input c X u))) 0 t <= b.
Proof.
  intros Hr Hb H t Ht. apply (back c X sqrt); [apply Ht|].
  pose proof (integral_below T (fun u => sqrt (norm2 n (input c Y u))) (fun u => b * exp (- (r / 2 * s c u)))
    (fun u => b * (- (r / 2 * gain T (Q2R (rho1 c)) (k c) u) * exp (- (r / 2 * s c u))))) as K.
  assert (E0 : b * exp (- (r / 2 * s c 0)) = b) by (rewrite s_0, Rmult_0_r, Ropp_0, exp_0; ring).
  cbv beta in K. rewrite E0 in K. apply K; auto; clear K t Ht.
  - intros u Hu. apply continuous_sqrt_comp. apply (power_cont c X S Hsrc (proj1 HX)). assumption.
  - intros u Hu. apply (is_derive_scal (fun u => exp (- (r / 2 * s c u)))). evar_last.
    + apply is_derive_comp; [apply is_derive_exp|]. apply @is_derive_opp. apply is_derive_scal. apply clock_derive; [exact HT|apply Hu].
    + unfold scal, opp; simpl; unfold mult; simpl. fold T. ring.
  - intros u Hu. apply (continuous_mult (fun _ => b) (fun u => exp (- (r / 2 * s c u)))); [apply continuous_const|].
    apply @ex_derive_continuous. eexists. apply is_derive_comp; [apply is_derive_exp|].
    apply @is_derive_opp. apply is_derive_scal. apply clock_derive; [exact HT|apply Hu].
  - intros u Hu. specialize (H u Hu). rewrite (power_eq c X) by apply Hu. set (g := gain _ _ _ u) in *.
    assert (G : 0 < g) by (apply gain_pos; auto; apply Hu). set (e := exp (- (r / 2 * s c u))).
    assert (E : exp (- (r * s c u)) = e * e) by (unfold e; rewrite <- exp_plus; f_equal; field).
    assert (P : 0 < e) by apply exp_pos. rewrite E in H.
    assert (B : 0 <= r / 2 * b) by (apply Rmult_le_pos; lra).
    replace (- (b * (- (r / 2 * g) * e))) with (g * (e * (r / 2 * b))) by ring.
    assert (B' : 0 <= e * (r / 2 * b)) by (apply Rmult_le_pos; lra).
    assert (B2 : 0 <= g * (e * (r / 2 * b))) by (apply Rmult_le_pos; lra).
    rewrite <- (sqrt_square _ B2). apply sqrt_le_1_alt. unfold sq in *.
    replace (g * (e * (r / 2 * b)) * (g * (e * (r / 2 * b)))) with (g * g * (e * e * (r / 2 * b * (r / 2 * b)))) by ring.
    apply Rmult_le_compat_l; [apply Rle_0_sqr|exact H].
  - intros u Hu. apply Rmult_le_pos; [assumption|left; apply exp_pos].
Qed.

(** two forms that fall by [m0 |E|^2] and, times [e^(s/k)], by [m1 |E|^2] times it *)
Lemma energy (F0 F1 : mat) (m0 m1 p z : R) : fits n F0 = true -> fits n F1 = true -> 0 < m0 -> 0 < m1 -> 0 <= p ->
  p * k c <= Q2R (rho1 c) * T -> exp (- p) <= z -> (forall x, 0 <= bil F0 x x) -> (forall x, 0 <= bil F1 x x) ->
  (forall x, m0 * norm2 n (lap es x) <= bil F0 (lap es x) x + bil F0 x (lap es x)) ->
  (forall x, m1 * norm2 n (lap es x) + / k c * bil F1 x x <= bil F1 (lap es x) x + bil F1 x (lap es x)) ->
  forall t, 0 <= t < T -> ex_RInt (fun u => norm2 n (input c X u)) 0 t /\ RInt (fun u => norm2 n (input c X u)) 0 t <=
    (Q2R (rho1 c) + k c / T * p) * (bil F0 (X 0) (X 0) / m0) + k c / T * (bil F1 (X 0) (X 0) / m1) * z.
Proof.
  intros Hf0 Hf1 M0 M1 Hp Hq Hz P0 P1 D0 D1 t Ht. apply (back c X (fun x => x)); [apply Ht|].
  destruct (fits_ok _ _ Hf0) as [A0 B0]. destruct (fits_ok _ _ Hf1) as [A1 B1]. pose proof HX as [[HM _] HQ].
  assert (KT : 0 < k c / T) by (apply Rdiv_lt_0_compat; assumption). pose proof (exp_pos (- p)) as Pz.
  set (a := (Q2R (rho1 c) + k c / T * p) / m0). set (b := k c / T * z / m1).
  assert (Ha : 0 < a) by (apply Rdiv_lt_0_compat; nra). assert (Hb : 0 < b) by (apply Rdiv_lt_0_compat; nra).
  pose proof (integral_below T (fun u => norm2 n (input c Y u))
    (fun u => a * (exp (0 * s c u) * bil F0 (Y u) (Y u)) + b * (exp (/ k c * s c u) * bil F1 (Y u) (Y u)))
    (fun u => a * (- (gain T (Q2R (rho1 c)) (k c) u * (exp (0 * s c u) *
        (bil F0 (lap es (Y u)) (Y u) + bil F0 (Y u) (lap es (Y u)) - 0 * bil F0 (Y u) (Y u)))))
      + b * (- (gain T (Q2R (rho1 c)) (k c) u * (exp (/ k c * s c u) *
        (bil F1 (lap es (Y u)) (Y u) + bil F1 (Y u) (lap es (Y u)) - / k c * bil F1 (Y u) (Y u))))))) as K.
  assert (E0 : a * (exp (0 * s c 0) * bil F0 (Y 0) (Y 0)) + b * (exp (/ k c * s c 0) * bil F1 (Y 0) (Y 0))
    = (Q2R (rho1 c) + k c / T * p) * (bil F0 (X 0) (X 0) / m0) + k c / T * (bil F1 (X 0) (X 0) / m1) * z).
  { rewrite s_0, !Rmult_0_r, exp_0. unfold Y, a, b. rewrite Rmax_left by lra. field. lra. }
  cbv beta in K. rewrite E0 in K. apply K; auto; clear K E0 t Ht.
  - intros u Hu. apply (power_cont c X S Hsrc (proj1 HX)). assumption.
  - intros u Hu. apply (is_derive_plus (fun u => a * (exp (0 * s c u) * bil F0 (Y u) (Y u)))
      (fun u => b * (exp (/ k c * s c u) * bil F1 (Y u) (Y u)))).
    + apply (is_derive_scal (fun u => exp (0 * s c u) * bil F0 (Y u) (Y u))). apply (form_derive n (lap es) _ _ _ HT X S 0 HM HQ); auto.
    + apply (is_derive_scal (fun u => exp (/ k c * s c u) * bil F1 (Y u) (Y u))). apply (form_derive n (lap es) _ _ _ HT X S 0 HM HQ); auto.
  - intros u Hu. apply (continuous_plus (fun u => a * (exp (0 * s c u) * bil F0 (Y u) (Y u)))
      (fun u => b * (exp (/ k c * s c u) * bil F1 (Y u) (Y u)))).
    + apply (continuous_mult (fun _ => a) (fun u => exp (0 * s c u) * bil F0 (Y u) (Y u))); [apply continuous_const|].
      apply (form_cont n (lap es) _ _ _ HT X S 0 HM HQ); auto.
    + apply (continuous_mult (fun _ => b) (fun u => exp (/ k c * s c u) * bil F1 (Y u) (Y u))); [apply continuous_const|].
      apply (form_cont n (lap es) _ _ _ HT X S 0 HM HQ); auto.
  - intros u Hu. rewrite (power_eq c X) by apply Hu. fold n es T. unfold Y. rewrite Rmax_right by apply Hu.
    pose proof (gain_above T (Q2R (rho1 c)) (k c) p u HT H1 Hk Hp Hq Hu) as G. fold T (s c u) in G.
    change (clock T (Q2R (rho1 c)) (k c) u) with (s c u) in G.
    assert (G0 : 0 < gain T (Q2R (rho1 c)) (k c) u) by (apply gain_pos; auto; apply Hu).
    set (g := gain T (Q2R (rho1 c)) (k c) u) in *. set (e := exp (/ k c * s c u)) in *. assert (Pe : 0 < e) by apply exp_pos.
    specialize (D0 (X u)). specialize (D1 (X u)). set (N := norm2 n (lap es (X u))) in *.
    assert (N0 : 0 <= N) by apply norm2_pos.
    set (d0 := bil F0 _ _ + bil F0 _ _) in *. set (d1 := bil F1 _ _ + bil F1 _ _) in *. set (v1 := bil F1 (X u) (X u)) in *.
    rewrite Rmult_0_l, exp_0.
    replace (- _) with (g * (a * d0 + b * (e * (d1 - / k c * v1)))) by ring.
    unfold sq. rewrite Rmult_assoc. apply Rmult_le_compat_l; [lra|].
    assert (U : a * (m0 * N) <= a * d0) by (apply Rmult_le_compat_l; lra).
    assert (W : b * (e * (m1 * N)) <= b * (e * (d1 - / k c * v1))).
    { apply Rmult_le_compat_l; [lra|]. apply Rmult_le_compat_l; lra. }
    replace (a * (m0 * N)) with ((Q2R (rho1 c) + k c / T * p) * N) in U by (unfold a; field; lra).
    replace (b * (e * (m1 * N))) with (k c / T * (z * e) * N) in W by (unfold b; field; lra).
    assert (Z : k c / T * (exp (- p) * e) <= k c / T * (z * e)).
    { apply Rmult_le_compat_l; [lra|]. apply Rmult_le_compat_r; lra. }
    assert (g * N <= (Q2R (rho1 c) + k c / T * p + k c / T * (z * e)) * N) by (apply Rmult_le_compat_r; lra). lra.
  - intros u Hu. pose proof (exp_pos (0 * s c u)). pose proof (exp_pos (/ k c * s c u)).
    specialize (P0 (Y u)). specialize (P1 (Y u)).
    apply Rplus_le_le_0_compat; apply Rmult_le_pos; try lra; apply Rmult_le_pos; lra.
Qed.
End Along.
