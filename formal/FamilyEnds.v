(** Where agents end that are drawn to a common kernel: what is known of sums of their limits, what follows of the pivots,
    and with these of every agent. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Slide Rest FamilyCertificate FamilyFlow FamilyChecker FamilySound FamilyMotion
  FamilyRows FamilyBox.
Open Scope R_scope.

(** * The check *)
Definition range : Type := Q * Q.
Definition begun (F : family) (i : nat) : Q := (start_at F i - nth i (sliding (frame F)) 0)%Q.
Definition sdotQ (u : list (nat * Q)) (x : nat -> Q) : Q := fold_right (fun p a => Qred (snd p * x (fst p) + a))%Q 0%Q u.
Definition apart (u : list (nat * Q)) := filter (fun p => negb (Qeq_bool (snd p) 0)) u.
Definition sparse (l : list Q) := apart (combine (seq 0 (length l)) l).
(** every member keeps the sum with these weights *)
Definition check_kept (l : list tie) (u : vec) : bool := let dq := common (map middle l) in good dq (map middle l) &&
  forallb (fun e => Qeq_bool (radius e) 0 || (weighed u e =? 0)%Z) l && zero_vec (mid_row dq l u).
(** what is known of a sum of limits: an agent stays in the hull; a sum is kept; an agent, or a mean of a function, moves
    by no more than a root, which a function proves *)
Inductive fact := Hull (i : nat) | Kept (u : vec) | Near (k i : nat) (root : Q) | Moved (k j : nat) (root : Q).
Section Check.
Variables (F : family) (h : list Q * list Q) (values : list (option Q)).
Definition off_by (k : nat) (f : lyapunov -> option (list (nat * Q) * Q)) (root : Q) : option (list (nat * Q) * range) :=
  match nth_error (bounds F) k, nth k values None with
  | Some b, Some v => match f b with
    | Some (u, q) => if at_first F && pos (decay b) && notneg root && Qle_bool (4 * (q * v)) (root * decay b * (root * decay b))
        then let m := sdotQ u (start_at F) in Some (u, (m - root, m + root)%Q) else None
    | None => None end
  | _, _ => None end.
Definition fact_of (f : fact) : option (list (nat * Q) * range) := match f with
  | Hull i => if at_first F then Some ([(i, 1%Q)], (entry (fst h) i, entry (snd h) i)) else None
  | Kept v => let u := sparse (map inject_Z v) in let m := sdotQ u (begun F) in
      if forallb (fun m => check_kept (ties m) v) (modes F) then Some (u, (m, m)) else None
  | Near k i root => off_by k (fun b => if mem i (its_agents (about b)) then Some ([(i, 1%Q)], nth i (inputs b) 0%Q) else None) root
  | Moved k j root => off_by k (fun b => match nth_error (means b) j with Some q => Some (sparse (fst q), snd q) | None => None end) root end.
Definition known (P : part) (fs : list fact) : list (list (nat * Q) * range) := flat_map (fun f => match fact_of f with
  | Some r => if forallb (fun p => mem (fst p) (its_agents P)) (fst r) then [r] else []
  | None => [] end) fs.
End Check.
Definition smaller (q a : Q) : Q := if Qle_bool q a then q else a.
Definition meet (a b : option range) : option range := match a, b with
  | Some p, Some q => Some (larger (fst p) (fst q), smaller (snd p) (snd q)) | Some p, None => Some p | None, _ => b end.
Definition scaled_by (c : Q) (p : range) : range := if Qle_bool 0 c then (Qred (c * fst p), Qred (c * snd p)) else (Qred (c * snd p), Qred (c * fst p)).
(** the sum as one of pivots *)
Definition of_pivots (P : part) (u : list (nat * Q)) : list (nat * Q) :=
  apart (map (fun b => (fst b, sdotQ u (fun k => nth k (snd b) 0%Q))) (still P)).
Definition pivot_of (P : part) (r : list (nat * Q) * range) : list (nat * range) := match of_pivots P (fst r) with
  | [(p, a)] => [(p, scaled_by (/ a) (snd r))] | _ => [] end.
Definition at_node (i : nat) (l : list (nat * range)) : option range :=
  fold_right (fun r a => if (fst r =? i)%nat then meet (Some (snd r)) a else a) None l.
Definition own_of (r : list (nat * Q) * range) : list (nat * range) := match fst r with
  | [(i, q)] => if Qeq_bool q 1 then [(i, snd r)] else [] | _ => [] end.
Definition total (u : list (nat * Q)) (at_ : nat -> option range) : option range := fold_right (fun p a => match at_ (fst p), a with
  | Some r, Some a => let r := scaled_by (snd p) r in Some (Qred (fst r + fst a), Qred (snd r + snd a))%Q | _, _ => None end) (Some (0, 0)%Q) u.
Definition between_ (e : Q * Q) (o : option range) : bool := match o with
  | Some p => Qle_bool (fst e - snd e) (fst p) && Qle_bool (snd p) (fst e + snd e) | None => false end.
Definition comes_to_rest (P : part) : bool := match becomes P with Depends => false | _ => true end.
(** a part that comes to rest, with what is known of the pivots and of each agent *)
Definition ranges (F : family) h values (kf : nat * list fact) : option (part * (list (nat * option range) * list (nat * range))) :=
  match nth_error (parts F) (fst kf) with
  | Some P => if comes_to_rest P then let rs := known F h values P (snd kf) in let ps := flat_map (pivot_of P) rs in
      Some (P, (map (fun b => (fst b, at_node (fst b) ps)) (still P), flat_map own_of rs)) else None
  | None => None end.
Definition found (i : nat) (l : list (nat * option range)) : option range :=
  fold_right (fun r a => if (fst r =? i)%nat then meet (snd r) a else a) None l.
Definition check_end_at (F : family) (rs : list (option (part * (list (nat * option range) * list (nat * range))))) (i : nat) (e : Q * Q) : bool :=
  forallb (fun m => check_kept (ties m) (unit i 1)) (modes F) && between_ e (Some (begun F i, begun F i)) ||
  existsb (fun r => match r with
    | Some (P, (ps, own)) => mem i (its_agents P) && between_ e (meet (total (apart (row P i)) (fun p => found p ps)) (at_node i own))
    | None => false end) rs.
Definition check_family_ends (F : family) (h : list Q * list Q) (es : list (nat * list fact)) : bool :=
  (negb (at_first F) || match es with [] => true | _ => check_hull F h end) &&
  let values := map (value_at F) (bounds F) in let rs := map (ranges F h values) es in
  forallb (fun ie => match snd ie with None => true | Some e => (fst ie <? order (frame F))%nat && check_end_at F rs (fst ie) e end)
    (combine (seq 0 (length (ends F))) (ends F)).

(** * Sums and intervals *)
Lemma sdot_apart u x : sdot (apart u) x = sdot u x.
Proof.
  induction u as [|p l IH]; [reflexivity|]. unfold apart in *. simpl. destruct (Qeq_bool (snd p) 0) eqn:E; simpl; rewrite IH; [|reflexivity].
  apply Qeq_R in E. rewrite E, Q2R_0. ring.
Qed.
Lemma sdot_sparse l x : sdot (sparse l) x = qdot l x.
Proof.
  unfold sparse. rewrite sdot_apart. assert (G : forall l m, sdot (combine (seq m (length l)) l) x = qdot l (fun j => x (m + j)%nat)).
  { clear l. induction l as [|a l IH]; intros m; simpl; [reflexivity|]. unfold sdot in *. simpl. rewrite IH, Nat.add_0_r. f_equal.
    apply qdot_ext. intros j _. unfold shift. f_equal. lia. }
  apply (G l 0%nat).
Qed.
Lemma qdot_Z l : forall x, qdot (map inject_Z l) x = dot l x.
Proof.
  induction l as [|a l IH]; intros x; simpl; [reflexivity|]. rewrite IH. f_equal. unfold Q2R, inject_Z. simpl. rewrite Rinv_1. ring.
Qed.
Lemma sdotQ_R u x : Q2R (sdotQ u x) = sdot u (fun i => Q2R (x i)).
Proof. induction u as [|p l IH]; [apply Q2R_0|]. cbn [sdotQ sdot fold_right]. fold (sdotQ l x) (sdot l (fun i => Q2R (x i))).
  rewrite Qred_R, Q2R_plus, Q2R_mult, IH. reflexivity. Qed.
Lemma sdot_same u x y : (forall p, In p u -> x (fst p) = y (fst p)) -> sdot u x = sdot u y.
Proof.
  induction u as [|p l IH]; intros H; simpl; [reflexivity|]. rewrite (H p) by (left; reflexivity).
  rewrite IH by (intros; apply H; right; assumption). reflexivity.
Qed.
Lemma sdot_plus u x y : sdot u (fun i => x i + y i) = sdot u x + sdot u y.
Proof. induction u as [|p l IH]; simpl; [ring|]. rewrite IH. ring. Qed.
Lemma sdot_scal_r u x a : sdot u (fun i => x i * a) = sdot u x * a.
Proof. induction u as [|p l IH]; simpl; [ring|]. rewrite IH. ring. Qed.
Definition holds (o : option range) (v : R) : Prop := match o with Some p => Q2R (fst p) <= v <= Q2R (snd p) | None => True end.
Lemma larger_R q a : Q2R (larger q a) = Q2R q \/ Q2R (larger q a) = Q2R a.
Proof. unfold larger. destruct (Qle_bool a q); auto. Qed.
Lemma smaller_R q a : Q2R (smaller q a) = Q2R q \/ Q2R (smaller q a) = Q2R a.
Proof. unfold smaller. destruct (Qle_bool q a); auto. Qed.
Lemma meet_ok a b v : holds a v -> holds b v -> holds (meet a b) v.
Proof.
  destruct a as [[l u]|], b as [[l' u']|]; simpl; auto. intros A B.
  destruct (larger_R l l') as [-> | ->], (smaller_R u u') as [-> | ->]; lra.
Qed.
Lemma scaled_by_ok a p v : holds (Some p) v -> holds (Some (scaled_by a p)) (Q2R a * v).
Proof.
  simpl. intros H. unfold scaled_by. destruct (Qle_bool 0 a) eqn:E; cbn [fst snd]; rewrite !Qred_R, !Q2R_mult.
  - apply Qle_R in E. rewrite Q2R_0 in E. split; apply Rmult_le_compat_l; lra.
  - assert (Q2R a < 0); [|nra]. apply Rnot_le_lt. intros N. rewrite <- Q2R_0 in N. apply Rle_Qle in N. apply Qle_bool_iff in N. congruence.
Qed.
Lemma at_node_ok y i l : (forall r, In r l -> holds (Some (snd r)) (y (fst r))) -> holds (at_node i l) (y i).
Proof.
  induction l as [|r l IH]; intros H; [exact I|]. cbn [at_node fold_right]. fold (at_node i l).
  assert (R : holds (at_node i l) (y i)) by (apply IH; intros; apply H; right; assumption).
  destruct (Nat.eqb_spec (fst r) i) as [<-|]; [|exact R]. apply meet_ok; [|exact R]. apply (H r). left. reflexivity.
Qed.
Lemma found_ok y i l : (forall r, In r l -> holds (snd r) (y (fst r))) -> holds (found i l) (y i).
Proof.
  induction l as [|r l IH]; intros H; [exact I|]. cbn [found fold_right]. fold (found i l).
  assert (R : holds (found i l) (y i)) by (apply IH; intros; apply H; right; assumption).
  destruct (Nat.eqb_spec (fst r) i) as [<-|]; [|exact R]. apply meet_ok; [|exact R]. apply (H r). left. reflexivity.
Qed.
Lemma total_ok y u f : (forall i, holds (f i) (y i)) -> holds (total u f) (sdot u y).
Proof.
  intros H. induction u as [|p l IH]; [simpl; rewrite Q2R_0; lra|]. cbn [total fold_right sdot]. fold (total l f) (sdot l y).
  pose proof (H (fst p)) as Hp. destruct (f (fst p)) as [r|]; [|exact I]. destruct (total l f) as [t|]; [|exact I].
  pose proof (scaled_by_ok (snd p) r _ Hp) as K. set (sc := scaled_by (snd p) r) in *.
  cbn [holds fst snd] in *. cbv zeta. cbn [fst snd]. rewrite !Qred_R, !Q2R_plus. lra.
Qed.
Lemma between_ok e o v : between_ e o = true -> holds o v -> Rabs (v - Q2R (fst e)) <= Q2R (snd e).
Proof.
  destruct o as [p|]; [|discriminate]. simpl. intros H B. apply andb_prop in H as [A C]. apply Qle_R in A, C.
  rewrite Q2R_minus in A. rewrite Q2R_plus in C. apply Rabs_le. lra.
Qed.

(** * Sums that every member keeps *)
Lemma kept_ok n l u : forallb (check_tie n) l = true -> check_kept l u = true -> forall w x, admits l w -> dot u (member l w x) = 0.
Proof.
  intros HT H w x Hw. unfold check_kept in H. cbv zeta in H. set (dq := common (map middle l)) in *. apply andb_prop in H as [H H3].
  apply andb_prop in H as [H1 H2]. destruct (member_ok n l HT w Hw) as [a [B E]].
  rewrite (dot_ext u _ (combined_at l a x)) by (intros; apply E).
  pose proof (mid_row_ok dq l u x H1) as M. destruct (good_ok _ _ H1) as [D0 _]. apply IZR_lt in D0.
  rewrite (zero_vec_ok _ H3 x) in M.
  symmetry in M. apply Rmult_integral in M as [M|M]; [lra|]. unfold functional in M. fold (functional l u a x).
  replace (functional l u a x) with (functional l u (middles l) x); [exact M|]. clear M E D0 H1 H3 dq Hw HT. revert a B.
  induction l as [|e l IH]; intros a B; [rewrite !functional_nil; reflexivity|]. simpl in H2. apply andb_prop in H2 as [A2 H2].
  rewrite !functional_cons. change (shift (middles (e :: l))) with (middles l). change (middles (e :: l) O) with (Q2R (middle e)).
  rewrite (IH H2 (shift a)) by (intros j e0 E0; apply (B (S j) e0 E0)). f_equal. apply orb_prop in A2 as [A2|A2].
  - apply Qeq_R in A2. pose proof (B 0%nat e eq_refl) as Be. unfold between in Be. unfold radius, middle in *.
    rewrite Q2R_0, Q2R_mult, Q2R_minus in A2. rewrite Q2R_mult, Q2R_plus. replace (Q2R (1 # 2)) with (/ 2) in * by (unfold Q2R; simpl; lra).
    replace (a 0%nat) with ((Q2R (lo e) + Q2R (hi e)) * / 2) by lra. reflexivity.
  - apply Z.eqb_eq in A2. rewrite A2. ring.
Qed.

(** * Along a motion from the initial state *)
Section Ends.
Variable F : family.
Let c := frame F.
Let n := order c.
Let T := deadline c.
Let rho := Q2R (rho1 c).
Hypothesis Hframe : check_frame F = true.
Hypothesis Hmodes : forallb (check_mode F) (modes F) = true.
Hypothesis Hbounds : forall b, In b (bounds F) -> (forall i, In i (its_agents (about b)) -> (i < n)%nat) /\
  decays F b /\ sizes F b /\ means_too F b.
Hypothesis Hrest : forall b, In b (bounds F) -> 0 < Q2R (decay b) -> forall X S, switches F X S -> exists y, forall i, In i (its_agents (about b)) ->
  filterlim (fun t => X t i) (at_left T) (locally (y i)) /\ xi (about b) y i = 0.
Hypothesis Hvalue : forall b v X, In b (bounds F) -> value_at F b = Some v -> (forall j, (j < n)%nat -> X j = Q2R (start_at F j)) ->
  0 <= Q2R v /\ below b (Q2R v) X.
Variables (X Sl : R -> nat -> R).
Hypothesis HS : starts F X Sl.
Lemma begun_R i : (i < n)%nat -> Q2R (begun F i) = X 0 i - Sl 0 i.
Proof. intros Hi. destruct HS as [_ H]. destruct (H i Hi) as [A B]. unfold begun, start_at. rewrite Q2R_minus, A, B. reflexivity. Qed.
Lemma unique (f : R -> R) (a b : R) : filterlim f (at_left T) (locally a) -> filterlim f (at_left T) (locally b) -> a = b.
Proof. intros A B. apply (filterlim_locally_unique (F := at_left T) f); assumption. Qed.
Lemma kept_limit v : let u := sparse (map inject_Z v) in forallb (fun m => check_kept (ties m) v) (modes F) = true ->
  (forall p, In p u -> (fst p < n)%nat) -> filterlim (fun t => sdot u (X t)) (at_left T) (locally (sdot u (fun i => Q2R (begun F i)))).
Proof.
  intros u HK Hu. rewrite forallb_forall in HK. destruct HS as [HM _]. destruct (settles_family F Hframe X Sl HM) as [t0 [_ [Ht0 HQ]]].
  destruct HM as [_ [C [D HD]]]. fold c in C, HD, Ht0, HQ. fold T in C, HD, Ht0, HQ. fold n in C, HQ.
  set (f := fun t => sdot u (fun i => X (Rmax 0 t) i - Sl (Rmax 0 t) i)).
  assert (Cf : forall t, 0 <= t < T -> continuous f t).
  { intros t Ht. apply (sdot_continuous u (fun t i => X (Rmax 0 t) i - Sl (Rmax 0 t) i)). intros p Hp.
    destruct (C t (fst p) ltac:(lra) (Hu p Hp)) as [C1 C2]. apply (continuous_minus (fun t => X (Rmax 0 t) (fst p)) (fun t => Sl (Rmax 0 t) (fst p))); assumption. }
  assert (Df : forall t, 0 < t < T -> (forall j, t <> D j) -> is_derive f t 0).
  { intros t Ht Hj. destruct (HD t Ht Hj) as [m [w [Hm [Hw E]]]].
    apply (is_derive_ext_loc (fun t => sdot u (fun i => X t i - Sl t i))).
    - exists (mkposreal t (proj1 Ht)). intros z Hz. unfold ball in Hz; simpl in Hz; unfold AbsRing_ball, abs, minus, plus, opp in Hz; simpl in Hz.
      apply Rabs_def2 in Hz. unfold f. rewrite Rmax_right by lra. reflexivity.
    - evar_last; [apply (sdot_derive u (fun t i => X t i - Sl t i) t (gain T rho (k c) t) (member (ties m) w (X t))); intros p Hp; apply E, Hu, Hp|].
      unfold u. rewrite sdot_sparse, qdot_Z, (kept_ok n (ties m) v (ties_ok F Hmodes m Hm) (HK m Hm) w (X t) Hw). ring. }
  assert (Fc : forall t, 0 <= t < T -> f t = f 0).
  { intros t Ht. apply Rle_antisym.
    - apply (falls f 0 T D Cf); [|exact Ht]. intros z Hz Hj. exists 0. split; [apply Df; assumption|lra].
    - assert (K : - f t <= - f 0); [|lra]. apply (falls (fun z => - f z) 0 T D); [| |exact Ht].
      + intros z Hz. apply (continuous_opp f). apply Cf. exact Hz.
      + intros z Hz Hj. exists 0. split; [|lra]. evar_last; [apply @is_derive_opp; apply Df; assumption|]. unfold opp; simpl; ring. }
  assert (F0 : f 0 = sdot u (fun i => Q2R (begun F i))).
  { unfold f. rewrite Rmax_left by lra. apply sdot_same. intros p Hp. symmetry. apply begun_R. apply Hu. exact Hp. }
  rewrite <- F0. apply (filterlim_ext_loc (fun _ => f 0)); [|apply filterlim_const].
  assert (Pe : 0 < T - t0) by lra. exists (mkposreal _ Pe). intros t Bt Lt. change (Rabs (t - T) < T - t0) in Bt. apply Rabs_def2 in Bt.
  rewrite <- (Fc t) by lra. unfold f. rewrite Rmax_right by lra. apply sdot_same. intros p Hp. rewrite HQ by (try (apply Hu; exact Hp); lra). lra.
Qed.
Variables (h : list Q * list Q) (y : nat -> R).
Hypothesis Hhull : at_first F = true -> check_hull F h = true.
Let values := map (value_at F) (bounds F).
Lemma off_ok o g root u r : (forall b u q, In b (bounds F) -> g b = Some (u, q) -> (forall p, In p u -> (fst p < n)%nat) -> forall x a, 0 <= a -> below b a x ->
    forall m w, In m (modes F) -> admits (ties m) w -> sq (sdot u (member (ties m) w x)) <= Q2R q * a) ->
  (forall p, In p u -> (fst p < n)%nat /\ filterlim (fun t => X t (fst p)) (at_left T) (locally (y (fst p)))) ->
  off_by F values o g root = Some (u, r) -> holds (Some r) (sdot u y).
Proof.
  intros Hg Hu E. unfold off_by, values in E. destruct (nth_error (bounds F) o) as [b|] eqn:Eb; [|discriminate].
  destruct (nth o _ None) as [v|] eqn:Ev; [|discriminate]. rewrite (nth_error_nth _ _ None (map_nth_error (value_at F) _ _ Eb)) in Ev.
  apply nth_error_In in Eb. destruct (g b) as [[u' q]|] eqn:Eg; [|discriminate]. destruct (_ && _) eqn:K in E; [|discriminate]. injection E as -> <-.
  apply andb_prop in K as [K K4]. apply andb_prop in K as [K K3]. apply andb_prop in K as [K1 K2]. apply Qpos in K2. apply notneg_R in K3. apply Qle_R in K4.
  rewrite !Q2R_mult in K4. replace (Q2R 4) with 4 in K4 by (unfold Q2R; simpl; lra).
  pose proof (starts_quiet F Hframe X Sl K1 HS) as HM. assert (H0 : forall j, (j < n)%nat -> X 0 j = Q2R (start_at F j)) by (intros j Hj; apply HS; exact Hj).
  destruct (Hvalue b v (X 0) Eb Ev H0) as [V0 V1]. destruct (Hbounds b Eb) as [_ [B1 _]].
  destruct (near_of F Hframe b B1 u (Q2R q) X Sl 0 (Q2R v) (fun p Hp => proj1 (Hu p Hp)) (Hg b u q Eb Eg (fun p Hp => proj1 (Hu p Hp))) K2 HM V0 V1) as [z Hz].
  assert (Ez : z = sdot u y).
  { apply (unique (fun t => sdot u (X t))); [apply (near_limit F Hframe _ X Sl 0 z _ _ K2 HM Hz)|]. apply (sdot_limit u X T y). intros p Hp. apply Hu. exact Hp. }
  destruct (positive_ F Hframe) as [P1 _]. specialize (Hz 0 ltac:(lra)).
  assert (S0 : s (frame F) 0 = 0) by (apply (clock_0 (deadline (frame F)) (Q2R (rho1 (frame F))) (k (frame F)) P1)).
  rewrite S0, !Rmult_0_r, Ropp_0, exp_0, !Rmult_1_r, Ez in Hz.
  set (A := Q2R q * Q2R v) in *. set (d := Q2R (decay b)) in *. set (ro := Q2R root) in *.
  assert (B : 2 * sqrt A <= ro * d).
  { assert (0 <= ro * d) by (apply Rmult_le_pos; lra). destruct (Rle_dec 0 A) as [LA|LA]; [|rewrite sqrt_neg_0 by lra; lra].
    pose proof (sqrt_sqrt A LA). pose proof (sqrt_pos A). apply Rsqr_incr_0_var; [|assumption]. unfold Rsqr. lra. }
  assert (B2 : 2 * sqrt A / d <= ro) by (apply (Rmult_le_reg_r d); [exact K2|]; unfold Rdiv; rewrite Rmult_assoc, Rinv_l by lra; lra).
  assert (E0 : Q2R (sdotQ u (start_at F)) = sdot u (X 0)) by (rewrite sdotQ_R; apply sdot_same; intros p Hp; symmetry; apply H0, Hu, Hp).
  apply Rabs_le_between in Hz. cbn [holds fst snd]. rewrite Q2R_minus, Q2R_plus, E0. fold ro. lra.
Qed.
Variable P : part.
Hypothesis HP : forall i, In i (its_agents P) -> (i < n)%nat.
Hypothesis Hy : forall i, In i (its_agents P) -> filterlim (fun t => X t i) (at_left T) (locally (y i)) /\ xi P y i = 0.
Lemma fact_ok f u r : fact_of F h values f = Some (u, r) -> forallb (fun p => mem (fst p) (its_agents P)) u = true -> holds (Some r) (sdot u y).
Proof.
  intros E Hu. rewrite forallb_forall in Hu.
  assert (Hl : forall p, In p u -> (fst p < n)%nat /\ filterlim (fun t => X t (fst p)) (at_left T) (locally (y (fst p)))).
  { intros p Hp. specialize (Hu p Hp). apply mem_In in Hu. split; [apply HP|apply Hy]; exact Hu. }
  destruct f as [i|v|k i root|k j root]; cbn [fact_of] in E.
  - destruct (at_first F) eqn:A; [|discriminate]. injection E as <- <-. destruct (Hl (i, 1%Q) ltac:(left; reflexivity)) as [Hi L]. cbn [fst] in Hi, L.
    rewrite sdot_one. cbn [holds fst snd]. pose proof (hull_ok F Hframe Hmodes h X Sl A (Hhull eq_refl) HS) as K. fold c in K. fold T n in K.
    destruct (positive_ F Hframe) as [P1 _]. fold c in P1. fold T in P1.
    assert (N : at_left T (fun t => Q2R (entry (fst h) i) <= X t i <= Q2R (entry (snd h) i))).
    { exists (mkposreal T P1). intros t Bt Lt. change (Rabs (t - T) < T) in Bt. apply Rabs_def2 in Bt. apply K; [lra|exact Hi]. }
    split; [apply (filterlim_le (F := at_left T) (fun _ => Q2R (entry (fst h) i)) (fun t => X t i) (Q2R (entry (fst h) i)) (y i))|
      apply (filterlim_le (F := at_left T) (fun t => X t i) (fun _ => Q2R (entry (snd h) i)) (y i) (Q2R (entry (snd h) i)))];
      try exact L; try apply filterlim_const; revert N; apply filter_imp; intros t Kt; apply Kt.
  - cbv zeta in E. destruct (forallb (fun m => check_kept (ties m) v) (modes F)) eqn:K; [|discriminate]. injection E as <- <-. set (u := sparse (map inject_Z v)) in *.
    assert (Ev : sdot u (fun i => Q2R (begun F i)) = sdot u y).
    { apply (unique (fun t => sdot u (X t))); [apply (kept_limit v K); intros p Hp; apply Hl; exact Hp|]. apply (sdot_limit u X T y). intros p Hp. apply Hl. exact Hp. }
    cbn [holds fst snd]. rewrite sdotQ_R, Ev. lra.
  - apply (off_ok k _ root u r) in E; [exact E| |exact Hl]. intros b u0 q Hb Eg _ x a Ha Hx m w Hm Hw.
    destruct (mem i (its_agents (about b))) eqn:Em; [|discriminate]. injection Eg as <- <-. apply mem_In in Em. rewrite sdot_one.
    destruct (Hbounds b Hb) as [_ [_ [B _]]]. apply (B x a i Ha Hx Em); assumption.
  - apply (off_ok k _ root u r) in E; [exact E| |exact Hl]. intros b u0 q Hb Eg _ x a Ha Hx m w Hm Hw.
    destruct (nth_error (means b) j) as [p|] eqn:Em; [|discriminate]. injection Eg as <- <-. apply nth_error_In in Em. rewrite sdot_sparse.
    destruct (Hbounds b Hb) as [_ [_ [_ B]]]. apply (B x a p Ha Hx Em); assumption.
Qed.
Lemma by_pivots u : (forall p, In p u -> In (fst p) (its_agents P)) -> sdot (of_pivots P u) y = sdot u y.
Proof.
  intros Hu. unfold of_pivots. rewrite sdot_apart.
  rewrite (sdot_same u y (fun i => sdot (row P i) y)) by (intros p Hp; destruct (Hy (fst p) (Hu p Hp)) as [_ Z]; rewrite xi_row in Z; lra).
  unfold row. induction (still P) as [|b l IH].
  - simpl. rewrite (sdot_same u _ (fun i => 0 * 0)) by (intros; ring). rewrite sdot_scal_r. ring.
  - transitivity (Q2R (sdotQ u (fun k => nth k (snd b) 0%Q)) * y (fst b) +
      sdot (map (fun b => (fst b, sdotQ u (fun k => nth k (snd b) 0%Q))) l) y); [reflexivity|]. rewrite IH, sdotQ_R, <- sdot_scal_r, <- sdot_plus.
    apply sdot_same. reflexivity.
Qed.
Lemma known_ok fs r : In r (known F h values P fs) -> holds (Some (snd r)) (sdot (fst r) y) /\ forall p, In p (fst r) -> In (fst p) (its_agents P).
Proof.
  intros H. unfold known in H. apply in_flat_map in H as [f [_ H]]. destruct (fact_of F h values f) as [[u q]|] eqn:E; [|destruct H].
  destruct (forallb _ (fst (u, q))) eqn:K; [|destruct H]. destruct H as [<-|[]]. cbn [fst snd] in *. split; [apply (fact_ok f u q E K)|].
  intros p Hp. rewrite forallb_forall in K. apply mem_In. apply K. exact Hp.
Qed.
Lemma pivot_ok fs r : In r (flat_map (pivot_of P) (known F h values P fs)) -> holds (Some (snd r)) (y (fst r)).
Proof.
  intros H. apply in_flat_map in H as [q [H1 H2]]. destruct (known_ok fs q H1) as [K1 K2]. unfold pivot_of in H2.
  pose proof (by_pivots (fst q) K2) as B. assert (N : forall p, In p (of_pivots P (fst q)) -> Q2R (snd p) <> 0).
  { intros p Hp Z. unfold of_pivots, apart in Hp. apply filter_In in Hp as [_ Hp]. apply negb_true_iff in Hp.
    assert (E : (snd p == 0)%Q) by (apply eqR_Qeq; rewrite Z, Q2R_0; reflexivity). apply Qeq_bool_iff in E. congruence. }
  destruct (of_pivots P (fst q)) as [|[p a] [|]]; try contradiction. destruct H2 as [<-|[]]. cbn [fst snd].
  specialize (N (p, a) ltac:(left; reflexivity)). cbn [snd] in N. pose proof (scaled_by_ok (/ a) _ _ K1) as K. rewrite <- B in K.
  cbn [sdot fold_right fst snd] in K. rewrite Q2R_inv in K by (intros E; apply N; apply Qeq_eqR in E; rewrite E; apply Q2R_0).
  replace (/ Q2R a * (Q2R a * y p + 0)) with (y p) in K by (field; exact N). exact K.
Qed.
Lemma own_ok fs r : In r (flat_map own_of (known F h values P fs)) -> holds (Some (snd r)) (y (fst r)).
Proof.
  intros H. apply in_flat_map in H as [q [H1 H2]]. destruct (known_ok fs q H1) as [K1 _]. unfold own_of in H2.
  destruct (fst q) as [|[i a] [|]] eqn:E; try contradiction. destruct (Qeq_bool a 1) eqn:Ea; [|contradiction]. destruct H2 as [<-|[]].
  apply Qeq_R in Ea. cbn [sdot fold_right fst snd] in *. rewrite Ea in K1. replace (Q2R 1) with 1 in K1 by (unfold Q2R; simpl; lra).
  replace (1 * y i + 0) with (y i) in K1 by ring. exact K1.
Qed.
Lemma total_of fs i : In i (its_agents P) -> let rs := known F h values P fs in
  holds (meet (total (apart (row P i)) (fun p => found p (map (fun b => (fst b, at_node (fst b) (flat_map (pivot_of P) rs))) (still P))))
    (at_node i (flat_map own_of rs))) (y i).
Proof.
  intros Hi rs. apply meet_ok; [|apply at_node_ok; intros r Hr; apply (own_ok fs r Hr)].
  destruct (Hy i Hi) as [_ Z]. rewrite xi_row in Z. replace (y i) with (sdot (apart (row P i)) y) by (rewrite sdot_apart; lra).
  apply total_ok. intros p. apply found_ok. intros r Hr. apply in_map_iff in Hr as [b [<- _]]. cbn [fst snd].
  apply at_node_ok. intros q Hq. apply (pivot_ok fs q Hq).
Qed.
End Ends.

Theorem ends_ok F h es : check_frame F = true -> forallb (check_mode F) (modes F) = true ->
  (forall b, In b (bounds F) -> (forall i, In i (its_agents (about b)) -> (i < order (frame F))%nat) /\ decays F b /\ sizes F b /\ means_too F b) ->
  (forall P, In P (parts F) -> (forall i, In i (its_agents P) -> (i < order (frame F))%nat) /\ (becomes P <> Depends ->
    forall X S, switches F X S -> exists y, forall i, In i (its_agents P) ->
      filterlim (fun t => X t i) (at_left (deadline (frame F))) (locally (y i)) /\ xi P y i = 0)) ->
  (forall b v X, In b (bounds F) -> value_at F b = Some v -> (forall j, (j < order (frame F))%nat -> X j = Q2R (start_at F j)) ->
    0 <= Q2R v /\ below b (Q2R v) X) ->
  check_family_ends F h es = true -> ends_claim F.
Proof.
  intros Hf Hm Hb Hr Hv H X S i m r HS E. unfold check_family_ends in H. cbv zeta in H. apply andb_prop in H as [H0 H]. rewrite forallb_forall in H.
  assert (L : (i < length (ends F))%nat).
  { destruct (Nat.lt_ge_cases i (length (ends F))) as [L|L]; [exact L|]. rewrite nth_overflow in E by exact L. discriminate. }
  assert (K : In (i, nth i (ends F) None) (combine (seq 0 (length (ends F))) (ends F))).
  { apply (in_numbered _ (ends F) 0%nat); [apply nth_error_nth'|]; exact L. }
  specialize (H _ K). cbn [fst snd] in H. rewrite E in H. apply andb_prop in H as [Hi H]. apply Nat.ltb_lt in Hi.
  unfold check_end_at in H. apply orb_prop in H as [H|H].
  - apply andb_prop in H as [H1 H2]. pose proof (kept_limit F Hf Hm X S HS (unit i 1) H1) as Lim. cbv zeta in Lim.
    assert (U : forall x, sdot (sparse (map inject_Z (unit i 1))) x = x i) by (intros x; rewrite sdot_sparse, qdot_Z, dot_unit; ring).
    exists (Q2R (begun F i)). split.
    + rewrite U in Lim. apply (filterlim_ext (fun t => sdot (sparse (map inject_Z (unit i 1))) (X t))); [intros t; apply U|]. apply Lim.
      intros p Hp. unfold sparse, apart in Hp. apply filter_In in Hp as [Hp _]. destruct p as [j q]. apply in_combine_l in Hp. apply in_seq in Hp.
      rewrite map_length in Hp. unfold unit in Hp. rewrite app_length, repeat_length in Hp. simpl in *. lia.
    + apply (between_ok (m, r) _ _ H2). cbn [holds fst snd]. split; apply Rle_refl.
  - apply existsb_exists in H as [g [Hg H]]. apply in_map_iff in Hg as [kf [Eg Hkf]]. unfold ranges in Eg.
    destruct (nth_error (parts F) (fst kf)) as [P|] eqn:EP; [|subst g; discriminate]. apply nth_error_In in EP.
    destruct (comes_to_rest P) eqn:Ed; [|subst g; discriminate]. cbv zeta in Eg. subst g. apply andb_prop in H as [H1 H2]. apply mem_In in H1.
    assert (ND : becomes P <> Depends) by (intros E'; unfold comes_to_rest in Ed; rewrite E' in Ed; discriminate).
    pose proof (proj1 HS) as HM. destruct (Hr P EP) as [HP Hr']. destruct (Hr' ND X S HM) as [y Hy]. exists (y i). split; [apply (Hy i H1)|].
    apply (between_ok (m, r) _ _ H2). apply (total_of F Hf Hm Hb Hv X S HS h y); [|exact HP|exact Hy|exact H1].
    intros A. rewrite A in H0. destruct es; [destruct Hkf|exact H0].
Qed.
