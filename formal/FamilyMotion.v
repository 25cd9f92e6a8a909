(** Motions of a family: under every signal forms decay and agents come to rest; what is at rest in all members. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Claims Input Slide Peak Reach Main Rest Wide FamilyCertificate FamilyFlow
  FamilyChecker FamilySound.
Open Scope R_scope.

(** * A value that moves as little as a decay lets it *)
Section Settles.
Variables (T rho1 k : R).
Hypotheses (HT : 0 < T) (H1 : 0 < rho1) (Hk : 0 < k).
Local Notation gain := (Certificate.gain T rho1 k).
Local Notation clock := (Certificate.clock T rho1 k).
Variables (x : R -> R) (t0 : R) (D : nat -> R) (r C : R).
Hypotheses (H0 : 0 <= t0 < T) (Hr : 0 < r) (HC : 0 <= C).
Hypothesis Cx : forall t, t0 <= t < T -> continuous x t.
Let a (t : R) := exp (- (r / 2 * clock t)).
Hypothesis Dx : forall t, t0 < t < T -> (forall j, t <> D j) -> exists u, is_derive x t (- (gain t * u)) /\ Rabs u <= C * a t.
Let m := 2 * C / r.
Lemma decay_derive t : t < T -> is_derive a t (- (r / 2) * gain t * a t).
Proof.
  intros Ht. unfold a. evar_last. { apply is_derive_comp; [apply is_derive_exp|]. apply @is_derive_opp.
    apply is_derive_scal. apply (clock_derive T rho1 k HT t Ht). }
  unfold scal, opp; simpl; unfold mult; simpl. ring.
Qed.
Lemma one_side (g : R) t1 t2 : g = 1 \/ g = -1 -> t0 <= t1 <= t2 -> t2 < T -> g * x t2 + m * a t2 <= g * x t1 + m * a t1.
Proof.
  intros Hg H12 H2. apply (falls (fun t => g * x t + m * a t) t1 T D); [| |lra].
  - intros t Ht. apply (continuous_plus (fun t => g * x t) (fun t => m * a t)).
    + apply (continuous_mult (fun _ => g)); [apply continuous_const|apply Cx; lra].
    + apply (continuous_mult (fun _ => m)); [apply continuous_const|]. apply @ex_derive_continuous. eexists. apply decay_derive. lra.
  - intros t Ht Hj. destruct (Dx t ltac:(lra) Hj) as [u [Du Bu]].
    exists (g * (- (gain t * u)) + m * (- (r / 2) * gain t * a t)). split.
    + apply (is_derive_plus (fun t => g * x t) (fun t => m * a t)); apply @is_derive_scal; [exact Du|apply decay_derive; lra].
    + pose proof (gain_pos T rho1 k H1 Hk t ltac:(lra)) as G.
      replace (m * (- (r / 2) * gain t * a t)) with (- (C * a t * gain t)) by (unfold m; field; lra).
      apply Rabs_le_between in Bu. assert (A : - (g * u) <= C * a t) by (destruct Hg as [-> | ->]; lra).
      apply (Rmult_le_compat_r (gain t)) in A; [|lra]. lra.
Qed.
Theorem settles_at : exists v, forall t, t0 <= t < T -> Rabs (x t - v) <= m * a t.
Proof.
  assert (M0 : 0 <= m) by (apply Rmult_le_pos; [lra|left; apply Rinv_0_lt_compat; exact Hr]).
  assert (K : forall t t', t0 <= t < T -> t0 <= t' < T -> x t' - m * a t' <= x t + m * a t).
  { intros t t' Ht Ht'. assert (P : 0 <= m * a t) by (apply Rmult_le_pos; [exact M0|left; apply exp_pos]).
    assert (P' : 0 <= m * a t') by (apply Rmult_le_pos; [exact M0|left; apply exp_pos]).
    destruct (Rle_dec t' t) as [L|L].
    - pose proof (one_side (-1) t' t ltac:(right; reflexivity) ltac:(lra) ltac:(lra)). lra.
    - pose proof (one_side 1 t t' ltac:(left; reflexivity) ltac:(lra) ltac:(lra)). lra. }
  destruct (completeness (fun v => exists t, t0 <= t < T /\ v = x t - m * a t)) as [v [U L]].
  - exists (x t0 + m * a t0). intros v [t [Ht ->]]. apply K; [lra|exact Ht].
  - exists (x t0 - m * a t0), t0. split; [lra|reflexivity].
  - exists v. intros t Ht. apply Rabs_le. split.
    + assert (v <= x t + m * a t); [|lra]. apply L. intros w [t' [Ht' ->]]. apply K; assumption.
    + assert (x t - m * a t <= v); [|lra]. apply U. exists t. split; [exact Ht|reflexivity].
Qed.
End Settles.

(** * Sums of a few agents *)
Definition sdot (u : list (nat * Q)) (x : nat -> R) : R := fold_right (fun p a => Q2R (snd p) * x (fst p) + a) 0 u.
Definition row (P : part) (i : nat) : list (nat * Q) := map (fun v => (fst v, nth i (snd v) 0%Q)) (still P).
Lemma sdot_one i x : sdot [(i, 1%Q)] x = x i.
Proof. unfold sdot. simpl. replace (Q2R 1) with 1 by (unfold Q2R; simpl; lra). ring. Qed.
Lemma xi_row P x i : xi P x i = x i - sdot (row P i) x.
Proof. unfold xi, row, sdot. f_equal. induction (still P) as [|v l IH]; simpl; [reflexivity|]. rewrite IH. reflexivity. Qed.
Lemma sdot_continuous u (f : R -> nat -> R) t : (forall p, In p u -> continuous (fun v => f v (fst p)) t) -> continuous (fun v => sdot u (f v)) t.
Proof.
  induction u as [|p l IH]; intros H; simpl; [apply continuous_const|].
  apply (continuous_plus (fun v => Q2R (snd p) * f v (fst p))); [|apply IH; intros; apply H; right; assumption].
  apply (continuous_mult (fun _ => Q2R (snd p))); [apply continuous_const|]. apply H. left. reflexivity.
Qed.
Lemma sdot_derive u (f : R -> nat -> R) t g L : (forall p, In p u -> is_derive (fun v => f v (fst p)) t (- (g * L (fst p)))) ->
  is_derive (fun v => sdot u (f v)) t (- (g * sdot u L)).
Proof.
  induction u as [|p l IH]; intros H; simpl; [rewrite Rmult_0_r, Ropp_0; apply (is_derive_const 0)|].
  replace (- (g * (Q2R (snd p) * L (fst p) + sdot l L))) with (Q2R (snd p) * - (g * L (fst p)) + - (g * sdot l L)) by ring.
  apply (is_derive_plus (fun v => Q2R (snd p) * f v (fst p))); [|apply IH; intros; apply H; right; assumption].
  apply (is_derive_scal (fun v => f v (fst p))). apply H. left. reflexivity.
Qed.
Lemma sdot_limit u (f : R -> nat -> R) T y : (forall p, In p u -> filterlim (fun t => f t (fst p)) (at_left T) (locally (y (fst p)))) ->
  filterlim (fun t => sdot u (f t)) (at_left T) (locally (sdot u y)).
Proof.
  induction u as [|p l IH]; intros H; simpl; [apply filterlim_const|].
  apply (filterlim_comp_2 (F := at_left T) (G := locally (Q2R (snd p) * y (fst p))) (H := locally (sdot l y))
    (fun t => Q2R (snd p) * f t (fst p)) (fun t => sdot l (f t)) (fun u v => plus u v)).
  - apply (filterlim_comp _ _ _ (fun t => f t (fst p)) (fun z => scal (Q2R (snd p)) z) _ (locally (y (fst p)))).
    + apply H. left. reflexivity.
    + apply (filterlim_scal_r (Q2R (snd p)) (y (fst p))).
  - apply IH. intros; apply H; right; assumption.
  - apply (filterlim_plus (Q2R (snd p) * y (fst p))).
Qed.

Section Main.
Variable F : family.
Let c := frame F.
Let n := order c.
Let T := deadline c.
Let rho := Q2R (rho1 c).
Hypothesis Hframe : check_frame F = true.
Hypothesis Hmodes : forallb (check_mode F) (modes F) = true.

Lemma frame_parts : check_protocol c = true /\ check_sliding c = true /\ edges c = [] /\
  forall i, (i < n)%nat -> exists P, In P (parts F) /\ In i (its_agents P).
Proof.
  unfold check_frame in Hframe. cbv zeta in Hframe. fold c in Hframe. apply andb_prop in Hframe as [H H5].
  apply andb_prop in H as [H H4]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H H2]. apply andb_prop in H as [_ H1].
  split; [exact H1|]. split; [unfold check_sliding; rewrite H2, H3; reflexivity|]. split; [destruct (edges c); [reflexivity|discriminate]|].
  intros i Hi. rewrite forallb_forall in H5. specialize (H5 i ltac:(apply in_seq; unfold n in Hi; lia)).
  apply existsb_exists in H5 as [P [A B]]. exists P. split; [exact A|apply mem_In; exact B].
Qed.
Lemma positive_ : 0 < T /\ 0 < rho /\ 0 < k c.
Proof. destruct frame_parts as [H _]. apply (T_pos c H). Qed.
Lemma ties_ok m : In m (modes F) -> forallb (check_tie n) (ties m) = true.
Proof.
  intros Hm. rewrite forallb_forall in Hmodes. specialize (Hmodes m Hm). unfold check_mode in Hmodes. cbv zeta in Hmodes.
  apply andb_prop in Hmodes as [H _]. apply andb_prop in H as [H _]. apply andb_prop in H as [H _]. apply andb_prop in H as [H _]. exact H.
Qed.
Lemma same_edges_ok l : forall m, same_edges l m = true -> l = m.
Proof.
  induction l as [|e l IH]; intros [|f m] H; try discriminate H; [reflexivity|]. simpl in H. apply andb_prop in H as [H1 H2].
  rewrite (IH m H2). f_equal. unfold same_edge in H1. apply andb_prop in H1 as [H1 D]. apply andb_prop in H1 as [H1 C].
  apply andb_prop in H1 as [A B]. apply Nat.eqb_eq in A, B. apply Z.eqb_eq in C, D.
  destruct e as [et es [eq ed]], f as [ft fs [fq fd]]. simpl in *. injection D as D. subst. reflexivity.
Qed.
Theorem modes_claim m : In m (modes F) -> mode_claim F m.
Proof.
  intros Hm. rewrite forallb_forall in Hmodes. specialize (Hmodes m Hm). unfold check_mode in Hmodes. cbv zeta in Hmodes.
  apply andb_prop in Hmodes as [H H5]. apply andb_prop in H as [H H4]. apply andb_prop in H as [H H3]. apply andb_prop in H as [_ H2].
  split; [apply same_edges_ok; exact H2|]. split; [apply Nat.eqb_eq; exact H3|].
  split; [apply wide_structure_ok; exact H4|apply (wide_claims_ok _ H5)].
Qed.

(** * Along a motion *)
Section Along.
Variables (X Sl : R -> nat -> R) (t0 : R).
Hypothesis HM : switches_from F X Sl t0.
Let Y (u : R) : nat -> R := X (Rmax t0 u).
Lemma Y_cont t i : t0 <= t < T -> (i < n)%nat -> continuous (fun u => Y u i) t.
Proof.
  intros Ht Hi. destruct HM as [[_ [C _]] [H0 _]]. fold c T in C, H0.
  apply (continuous_ext (fun u => X (Rmax 0 (Rmax t0 u)) i)).
  { intros u. unfold Y. f_equal. apply Rmax_right. eapply Rle_trans; [|apply Rmax_l]. lra. }
  apply (continuous_comp (fun u => Rmax t0 u) (fun u => X (Rmax 0 u) i)); [apply continuous_Rmax|].
  apply C; [|exact Hi]. rewrite Rmax_right; lra.
Qed.
Lemma Y_moves : exists D : nat -> R, forall t, t0 < t < T -> (forall j, t <> D j) -> exists m w, In m (modes F) /\ admits (ties m) w /\
  forall i, (i < n)%nat -> is_derive (fun u => Y u i) t (- (gain T rho (k c) t * member (ties m) w (Y t) i)).
Proof.
  destruct HM as [[_ [_ [D HD]]] [H0 Z]]. fold c T rho in HD, H0, Z. exists D. intros t Ht Hj.
  destruct (HD t ltac:(lra) Hj) as [m [w [Hm [Hw E]]]]. exists m, w. split; [exact Hm|]. split; [exact Hw|]. intros i Hi.
  apply (is_derive_ext_loc (fun u => X u i - Sl u i)).
  - assert (He : 0 < Rmin (t - t0) (T - t)) by (apply Rmin_pos; lra). exists (mkposreal _ He). intros u Hu.
    unfold ball in Hu; simpl in Hu; unfold AbsRing_ball, abs, minus, plus, opp in Hu; simpl in Hu.
    pose proof (Rmin_l (t - t0) (T - t)). pose proof (Rmin_r (t - t0) (T - t)). apply Rabs_def2 in Hu.
    unfold Y. rewrite Rmax_right by lra. rewrite Z by (auto; lra). apply Rminus_0_r.
  - unfold Y. rewrite Rmax_right by lra. apply E. exact Hi.
Qed.
Lemma Y_eq t : t0 <= t -> Y t = X t.
Proof. intros. unfold Y. f_equal. apply Rmax_right. assumption. Qed.
(** a form that decays in every member decays along every motion *)
Lemma form_decays (G : mat) (b : R) : fits n G = true ->
  (forall m w x, In m (modes F) -> admits (ties m) w ->
     b * bil G x x <= bil G (member (ties m) w x) x + bil G x (member (ties m) w x)) ->
  forall t, t0 <= t < T -> bil G (X t) (X t) <= exp (- (b * (s c t - s c t0))) * bil G (X t0) (X t0).
Proof.
  intros HG Hb t Ht. destruct (fits_ok _ _ HG) as [G1 G2]. destruct Y_moves as [D HD]. destruct HM as [_ [H0 _]]. fold c T in H0.
  destruct positive_ as [P1 [P2 P3]].
  assert (Es : forall u, u < T -> is_derive (fun u => exp (b * s c u)) u (b * gain T rho (k c) u * exp (b * s c u))).
  { intros u Hu. evar_last. { apply is_derive_comp; [apply is_derive_exp|]. apply is_derive_scal. apply (clock_derive T rho (k c) P1 u Hu). }
    unfold scal; simpl; unfold mult; simpl. change (clock T rho (k c) u) with (s c u). ring. }
  assert (K : exp (b * s c t) * bil G (Y t) (Y t) <= exp (b * s c t0) * bil G (Y t0) (Y t0)).
  { apply (falls (fun u => exp (b * s c u) * bil G (Y u) (Y u)) t0 T D); [| |exact Ht].
    - intros u Hu. apply (continuous_mult (fun u => exp (b * s c u)) (fun u => bil G (Y u) (Y u))).
      + apply @ex_derive_continuous. eexists. apply Es. lra.
      + apply (continuous_bil G n); auto; intros; apply Y_cont; auto; lia.
    - intros u Hu Hj. destruct (HD u Hu Hj) as [m [w [Hm [Hw E]]]]. specialize (Hb m w (Y u) Hm Hw).
      set (L := member (ties m) w (Y u)) in *. set (g := gain T rho (k c) u) in *.
      exists ((b * g * exp (b * s c u)) * bil G (Y u) (Y u) + exp (b * s c u) * (bil G (fun i => - (g * L i)) (Y u) + bil G (Y u) (fun i => - (g * L i)))).
      split.
      + apply (is_derive_mult (fun u => exp (b * s c u)) (fun u => bil G (Y u) (Y u)) u); [apply Es; lra| |intros; apply Rmult_comm].
        apply (is_derive_bil G n); auto; intros; apply E; auto; lia.
      + rewrite (bil_ext_l G (fun i => - (g * L i)) (fun i => - g * L i)) by (intros; ring). rewrite (bil_ext_r G n _ (fun i => - (g * L i)) (fun i => - g * L i) G2) by (intros; ring).
        rewrite bil_scal_l, bil_scal_r. pose proof (gain_pos T rho (k c) P2 P3 u ltac:(lra)) as Gp. fold g in Gp.
        pose proof (exp_pos (b * s c u)) as Pe. set (e := exp (b * s c u)) in *.
        assert (0 < e * g) by nra. nra. }
  rewrite !Y_eq in K by lra. apply (Rmult_le_reg_l (exp (b * s c t))); [apply exp_pos|].
  rewrite <- Rmult_assoc, <- exp_plus. replace (b * s c t + - (b * (s c t - s c t0))) with (b * s c t0) by ring. exact K.
Qed.
End Along.
Lemma settles_family X Sl : switches F X Sl -> exists t0, switches_from F X Sl t0.
Proof.
  intros HM. destruct frame_parts as [HP [_ [HE _]]]. pose proof HM as [HS [C _]]. fold c in HS, C.
  destruct (settles c HP Sl Sl) as [t0 [_ Q]].
  - split; [|exact HS]. split.
    + intros t i Ht Hi. rewrite HE. apply (is_derive_ext (fun _ => 0)); [intros; symmetry; apply Rminus_diag_eq; reflexivity|].
      simpl. rewrite Rmult_0_r, Ropp_0. apply @is_derive_const.
    + intros t i Ht Hi. split; apply (C t i Ht Hi).
  - exists t0. split; [exact HM|exact Q].
Qed.

(** * Bounds *)
Section Bound.
Variable b : lyapunov.
Let P := about b.
Definition decays : Prop := forall X Sl t0 t a, switches_from F X Sl t0 -> t0 <= t < T -> 0 <= a -> below b a (X t0) ->
  below b (exp (- (Q2R (decay b) * (s c t - s c t0))) * a) (X t).
Definition sizes : Prop := forall x a i, 0 <= a -> below b a x -> In i (its_agents P) -> sq (xi P x i) <= Q2R (nth i (offs b) 0%Q) * a /\
  forall m w, In m (modes F) -> admits (ties m) w -> sq (member (ties m) w x i) <= Q2R (nth i (inputs b) 0%Q) * a.
Definition means_too : Prop := forall x a q, 0 <= a -> below b a x -> In q (means b) -> forall m w, In m (modes F) ->
  admits (ties m) w -> sq (qdot (fst q) (member (ties m) w x)) <= Q2R (snd q) * a.
Hypotheses (HD : decays) (HS : sizes).
Hypothesis Hagents : forall i, In i (its_agents P) -> (i < n)%nat.
(** how near to its end a sum of agents is of which the members move as little as the function *)
Lemma near_of u q X Sl t0 a : (forall v, In v u -> (fst v < n)%nat) ->
  (forall x a, 0 <= a -> below b a x -> forall m w, In m (modes F) -> admits (ties m) w -> sq (sdot u (member (ties m) w x)) <= q * a) ->
  0 < Q2R (decay b) -> switches_from F X Sl t0 -> 0 <= a -> below b a (X t0) ->
  exists v, forall t, t0 <= t < T -> Rabs (sdot u (X t) - v) <=
    2 * sqrt (q * a * exp (Q2R (decay b) * s c t0)) / Q2R (decay b) * exp (- (Q2R (decay b) / 2 * s c t)).
Proof.
  intros Hu HU Hr HM Ha H0. set (r := Q2R (decay b)) in *. destruct positive_ as [P1 [P2 P3]]. pose proof HM as [_ [Ht0 _]]. fold c T in Ht0.
  destruct (Y_moves X Sl t0 HM) as [D HDm]. set (C := sqrt _).
  destruct (settles_at T rho (k c) P1 P2 P3 (fun t => sdot u (X (Rmax t0 t))) t0 D r C Ht0 Hr (sqrt_pos _)) as [v Hv].
  - intros t Ht. apply sdot_continuous. intros p Hp. apply (Y_cont X Sl t0 HM t (fst p) Ht). apply Hu. exact Hp.
  - intros t Ht Hj. destruct (HDm t Ht Hj) as [m [w [Hm [Hw E]]]]. exists (sdot u (member (ties m) w (X (Rmax t0 t)))).
    split; [apply sdot_derive; intros p Hp; apply E, Hu, Hp|]. rewrite Rmax_right by lra.
    specialize (HD X Sl t0 t a HM ltac:(lra) Ha H0). fold r in HD. set (e := exp (- (r * (s c t - s c t0)))) in *.
    assert (Pe : 0 < e) by apply exp_pos. pose proof (HU (X t) (e * a) ltac:(apply Rmult_le_pos; lra) HD m w Hm Hw) as K.
    apply abs_sq; [apply Rmult_le_pos; [apply sqrt_pos|left; apply exp_pos]|].
    eapply Rle_trans; [exact K|].
    assert (Q0 : 0 <= q * a).
    { pose proof (sq_pos (sdot u (member (ties m) w (X t)))) as Z. assert (0 <= e * (q * a)) by lra.
      apply (Rmult_le_reg_l e); [exact Pe|]. lra. }
    assert (Ee : e = exp (r * s c t0) * sq (exp (- (r / 2 * s c t)))).
    { unfold e, sq. rewrite <- !exp_plus. f_equal. lra. }
    unfold C, sq. set (e2 := exp (- (r / 2 * s c t))) in *. set (e0 := exp (r * s c t0)) in *.
    change (exp (- (r / 2 * clock T rho (k c) t))) with e2.
    replace (sqrt (q * a * e0) * e2 * (sqrt (q * a * e0) * e2)) with (sqrt (q * a * e0) * sqrt (q * a * e0) * (e2 * e2)) by ring.
    rewrite sqrt_sqrt by (apply Rmult_le_pos; [exact Q0|left; apply exp_pos]). rewrite Ee. unfold sq. right. ring.
  - exists v. intros t Ht. specialize (Hv t Ht). rewrite Rmax_right in Hv by lra. exact Hv.
Qed.
Lemma near_limit (f : R -> R) X Sl t0 v C r : 0 < r -> switches_from F X Sl t0 ->
  (forall t, t0 <= t < T -> Rabs (f t - v) <= C * exp (- (r / 2 * s c t))) -> filterlim f (at_left T) (locally v).
Proof.
  intros Hr HM Hv. destruct positive_ as [P1 [P2 P3]]. pose proof HM as [_ HQ].
  apply (reaches n T rho (k c) P1 P2 P3 (fun t _ => f t) Sl t0 HQ 0%nat v (sq C) r Hr (sq_pos C)). intros t Ht. specialize (Hv t Ht).
  assert (E : exp (- (r * clock T rho (k c) t)) = sq (exp (- (r / 2 * s c t)))) by (unfold sq; rewrite <- exp_plus; f_equal; unfold s; fold T rho; lra).
  rewrite E. set (e := exp _) in *. assert (0 < e) by apply exp_pos. apply Rabs_le_between in Hv. unfold sq.
  replace (C * C * (e * e)) with (C * e * (C * e)) by ring. nra.
Qed.
End Bound.

(** * States at rest *)
Lemma rest_vec_ok dl l vz i : good dl (map lo l) = true ->
  vec_of (rest_vec dl l vz) i = IZR dl * combined_at l (fun j => Q2R (lo (nth j l (Tie 0 0 0 0 false)))) (vec_of vz) i.
Proof.
  intros G. apply good_ok in G as [D0 D1]. unfold rest_vec.
  induction l as [|e l IH]; [unfold vec_of; destruct i; simpl; ring|]. cbn [fold_right combined_at]. unfold vec_of at 1. rewrite nth_vadd, plus_IZR.
  fold (vec_of (fold_right (fun e a => vadd (scale (scaled dl (lo e) * zdot (hvec e) vz) (fvec e)) a) [] l) i).
  rewrite IH by (intros; apply D1; right; assumption).
  assert (E : IZR (nth i (scale (scaled dl (lo e) * zdot (hvec e) vz) (fvec e)) 0%Z) = IZR (scaled dl (lo e) * zdot (hvec e) vz) * vec_of (fvec e) i).
  { unfold scale, vec_of. destruct (Z.eqb_spec (scaled dl (lo e) * zdot (hvec e) vz) 0) as [Z0|_]; [rewrite Z0; destruct i; simpl; ring|].
    rewrite <- mult_IZR. f_equal. rewrite <- (Z.mul_0_r (scaled dl (lo e) * zdot (hvec e) vz)) at 1. apply map_nth. }
  rewrite E, mult_IZR, scaled_ok, zdot_ok by (try exact D0; apply D1; left; reflexivity). unfold shift. simpl. ring.
Qed.
Lemma zero_entry l : zero_vec l = true -> forall i, vec_of l i = 0.
Proof.
  intros H i. unfold vec_of. destruct (Nat.lt_ge_cases i (length l)) as [L|L]; [|rewrite nth_overflow by exact L; reflexivity].
  unfold zero_vec in H. rewrite forallb_forall in H. specialize (H _ (nth_In l 0%Z L)). apply Z.eqb_eq in H. rewrite <- H. reflexivity.
Qed.
Lemma rest_ok sw m v : In m (modes F) -> check_at_rest sw (ties m) v = true -> forall w i, admits (ties m) w ->
  member (ties m) w (fun j => Q2R (nth j v 0%Q)) i = 0.
Proof.
  intros Hm H w i Hw. unfold check_at_rest in H. cbv zeta in H. set (vz := map (scaled sw) v) in *. set (dl := common _) in *.
  apply andb_prop in H as [H H4]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  destruct (member_ok n (ties m) (ties_ok m Hm) w Hw) as [a [B E]]. rewrite E.
  destruct (good_ok _ _ H1) as [S0 _]. destruct (good_ok _ _ H2) as [D0 _]. apply IZR_lt in S0, D0.
  assert (EZ : forall j, vec_of vz j = IZR sw * Q2R (nth j v 0%Q)) by (intros j; unfold vec_of, vz; apply nth_scaled; exact H1).
  assert (K : combined_at (ties m) a (fun j => Q2R (nth j v 0%Q)) i * IZR sw =
    combined_at (ties m) (fun j => Q2R (lo (nth j (ties m) (Tie 0 0 0 0 false)))) (vec_of vz) i).
  { clear E Hw H4 H2 D0 dl. revert a B H3. induction (ties m) as [|e l IH]; intros a B H3; cbn [combined_at]; [ring|].
    simpl in H3. apply andb_prop in H3 as [A1 A2]. rewrite Rmult_plus_distr_r.
    pose proof (IH (shift a) (fun j e0 E0 => B (S j) e0 E0) A2) as IH'. unfold shift in IH' |- *. cbn [nth] in *. rewrite IH'. f_equal.
    assert (Eh : dot (hvec e) (vec_of vz) = IZR sw * dot (hvec e) (fun j => Q2R (nth j v 0%Q))).
    { rewrite (dot_ext _ _ (fun j => IZR sw * Q2R (nth j v 0%Q))) by (intros; apply EZ). apply dot_scal. }
    rewrite Eh. apply orb_prop in A1 as [A1|A1].
    - apply Qeq_R in A1. pose proof (B 0%nat e eq_refl) as Be. unfold between in Be. replace (a 0%nat) with (Q2R (lo e)) by lra. ring.
    - apply Z.eqb_eq in A1. rewrite zdot_ok, A1 in Eh. assert (dot (hvec e) (fun j => Q2R (nth j v 0%Q)) = 0) by nra. rewrite H. ring. }
  pose proof (rest_vec_ok dl (ties m) vz i H2) as R. rewrite (zero_entry _ H4), <- K in R.
  assert (IZR dl * IZR sw * combined_at (ties m) a (fun j => Q2R (nth j v 0%Q)) i = 0) by lra.
  apply Rmult_integral in H as [H|H]; [nra|exact H].
Qed.
End Main.
