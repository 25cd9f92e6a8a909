(** How near a motion of a family stays to a state at rest: what is farthest never grows, and how far agents are from the
    farthest falls no faster than [e^(-D s)], and grows by what mandatory edges draw. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Ranalysis5 Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Claims Mean Table Dominance Rest Wide FamilyCertificate FamilyFlow
  FamilyChecker FamilySound FamilyMotion FamilyRows FamilyRest.
Open Scope R_scope.

(** * What mandatory edges draw *)
(** at most so much all edges of a mode move an agent *)
Definition heft (l : list tie) : R := fold_right (fun e a => 2 * (Rabs (Q2R (bottom e)) + Rabs (Q2R (top e))) + a) 0 l.
(** how far [M] is from the sources of an agent, in the direction [g], by the weights of mandatory edges *)
Definition spare (es : list edge) (M g : R) (x : nat -> R) (i : nat) : R :=
  esum es (fun e => if (tgt e =? i)%nat then Rabs (Q2R (wt e)) * M - g * (Q2R (wt e) * x (src e)) else 0).
Lemma heft_pos l : 0 <= heft l.
Proof.
  induction l as [|e l IH]; simpl; [lra|]. pose proof (Rabs_pos (Q2R (bottom e))). pose proof (Rabs_pos (Q2R (top e))). lra.
Qed.
Lemma esum_app l l' f : esum (l ++ l') f = esum l f + esum l' f.
Proof. induction l as [|e l IH]; simpl; [ring|]. rewrite IH. ring. Qed.
Lemma sign_at_most g x M : (g = 1 \/ g = -1) -> Rabs x <= M -> g * x <= M.
Proof. intros [-> | ->] H; apply Rabs_le_between in H; lra. Qed.
Lemma spare_term w x M g : (g = 1 \/ g = -1) -> Rabs x <= M -> 0 <= Rabs w * M - g * (w * x).
Proof.
  intros Hg Hx. assert (B : Rabs (w * x) <= Rabs w * M) by (rewrite Rabs_mult; apply Rmult_le_compat_l; [apply Rabs_pos|exact Hx]).
  pose proof (sign_at_most g (w * x) (Rabs w * M) Hg B). lra.
Qed.
Lemma spare_one es M g x i e : (g = 1 \/ g = -1) -> (forall f, In f es -> tgt f = i -> Rabs (x (src f)) <= M) -> In e es -> tgt e = i ->
  Rabs (Q2R (wt e)) * M - g * (Q2R (wt e) * x (src e)) <= spare es M g x i.
Proof.
  intros Hg. unfold spare. induction es as [|f es IH]; intros H He Ht; [destruct He|]. simpl.
  assert (P : forall l, (forall f, In f l -> tgt f = i -> Rabs (x (src f)) <= M) ->
    0 <= esum l (fun e => if (tgt e =? i)%nat then Rabs (Q2R (wt e)) * M - g * (Q2R (wt e) * x (src e)) else 0)).
  { induction l as [|f' l IHl]; intros Hl; simpl; [lra|]. specialize (IHl ltac:(intros; apply Hl; [right|]; assumption)).
    destruct (Nat.eqb_spec (tgt f') i) as [E|_]; [|lra].
    pose proof (spare_term (Q2R (wt f')) (x (src f')) M g Hg (Hl f' ltac:(left; reflexivity) E)). lra. }
  destruct He as [->|He].
  - rewrite Ht, Nat.eqb_refl. specialize (P es ltac:(intros; apply H; [right|]; assumption)). lra.
  - specialize (IH ltac:(intros; apply H; [right|]; assumption) He Ht). destruct (Nat.eqb_spec (tgt f) i) as [E|_]; [|lra].
    pose proof (spare_term (Q2R (wt f)) (x (src f)) M g Hg (H f ltac:(left; reflexivity) E)). lra.
Qed.
Lemma spare_pos es M g x i : (g = 1 \/ g = -1) -> (forall f, In f es -> tgt f = i -> Rabs (x (src f)) <= M) -> 0 <= spare es M g x i.
Proof.
  intros Hg H. unfold spare. induction es as [|f es IH]; simpl; [lra|]. specialize (IH ltac:(intros; apply H; [right|]; assumption)).
  destruct (Nat.eqb_spec (tgt f) i) as [E|_]; [|lra]. pose proof (spare_term (Q2R (wt f)) (x (src f)) M g Hg (H f ltac:(left; reflexivity) E)). lra.
Qed.
Lemma heard_spares t s0 w w0 x i g M : (g = 1 \/ g = -1) -> Rabs (w - w0) + Rabs w0 <= Rabs w -> (t = i -> Rabs (x s0) <= M) -> Rabs (x i) <= M ->
  (if (t =? i)%nat then Rabs w0 * M - g * (w0 * x s0) else 0) <= g * heard t s0 w x i + Rabs w * (M - g * x i).
Proof.
  intros Hg Hw Hs Hi. unfold heard. pose proof (sign_at_most g (x i) M Hg Hi) as K. destruct (Nat.eqb_spec t i) as [->|_].
  - pose proof (spare_term (w - w0) (x s0) M g Hg (Hs eq_refl)) as S. pose proof (Rabs_pos (x i)).
    assert (Rabs (w - w0) * M + Rabs w0 * M <= Rabs w * M) by (rewrite <- Rmult_plus_distr_r; apply Rmult_le_compat_r; lra).
    replace (g * ((w - w0) * x s0)) with (g * (w * x s0) - g * (w0 * x s0)) in S by ring. lra.
  - rewrite Rmult_0_r, Rplus_0_l. apply Rmult_le_pos; [apply Rabs_pos|lra].
Qed.
Lemma draws n (C : list nat) l : forallb (check_tie n) l = true -> (forall e, In e l -> In (head e) C <-> In (tail e) C) ->
  forall w x i g M, admits l w -> (g = 1 \/ g = -1) -> In i C -> (forall j, In j C -> Rabs (x j) <= M) ->
  spare (smallest l) M g x i <= g * member l w x i + heft l * (M - g * x i).
Proof.
  induction l as [|e l IH]; intros HT HC w x i g M Hw Hg Hi Hx; [unfold spare, heft; simpl; lra|].
  simpl in HT. apply andb_prop in HT as [HT1 HT2].
  specialize (IH HT2 (fun e0 H => HC e0 (or_intror H)) (shift w) x i g M (fun j e0 E => Hw (S j) e0 E) Hg Hi Hx).
  pose proof (Hw 0%nat e eq_refl) as W0. destruct (HC e (or_introl eq_refl)) as [C1 C2]. set (v := w 0%nat) in *.
  pose proof (sign_at_most g (x i) M Hg (Hx i Hi)) as U. unfold spare, smallest in *. cbn [flat_map member heft fold_right]. fold (heft l). fold v. rewrite esum_app.
  assert (V : Rabs v <= Rabs (Q2R (bottom e)) + Rabs (Q2R (top e))).
  { pose proof (Rle_abs (Q2R (top e))). pose proof (Rle_abs (- Q2R (bottom e))) as B. rewrite Rabs_Ropp in B.
    pose proof (Rabs_pos (Q2R (top e))). pose proof (Rabs_pos (Q2R (bottom e))). apply Rabs_le. lra. }
  assert (G : forall q, Rabs (v - Q2R q) + Rabs (Q2R q) <= Rabs v ->
    esum (there e q) (fun e => if (tgt e =? i)%nat then Rabs (Q2R (wt e)) * M - g * (Q2R (wt e) * x (src e)) else 0) <=
    g * pulls e v x i + 2 * (Rabs (Q2R (bottom e)) + Rabs (Q2R (top e))) * (M - g * x i)).
  { intros q Hq.
    pose proof (heard_spares (head e) (tail e) v (Q2R q) x i g M Hg Hq ltac:(intros E; apply Hx, C1; rewrite E; exact Hi) (Hx i Hi)) as A.
    pose proof (heard_spares (tail e) (head e) v (Q2R q) x i g M Hg Hq ltac:(intros E; apply Hx, C2; rewrite E; exact Hi) (Hx i Hi)) as B.
    assert (Z : Rabs v * (M - g * x i) <= (Rabs (Q2R (bottom e)) + Rabs (Q2R (top e))) * (M - g * x i)) by (apply Rmult_le_compat_r; lra).
    assert (Z1 : 0 <= Rabs v * (M - g * x i)) by (apply Rmult_le_pos; [apply Rabs_pos|lra]).
    unfold pulls, there. destruct (mutual e); simpl; lra. }
  assert (E : esum (if Qlt_le_dec 0 (bottom e) then there e (bottom e) else if Qlt_le_dec (top e) 0 then there e (top e) else [])
    (fun e => if (tgt e =? i)%nat then Rabs (Q2R (wt e)) * M - g * (Q2R (wt e) * x (src e)) else 0) <=
    g * pulls e v x i + 2 * (Rabs (Q2R (bottom e)) + Rabs (Q2R (top e))) * (M - g * x i)).
  { destruct (Qlt_le_dec 0 (bottom e)) as [Q|_]; [|destruct (Qlt_le_dec (top e) 0) as [Q|_]].
    - apply G. apply Qlt_Rlt in Q. rewrite Q2R_0 in Q. rewrite !Rabs_right by lra. lra.
    - apply G. apply Qlt_Rlt in Q. rewrite Q2R_0 in Q. rewrite !Rabs_left1 by lra. lra.
    - specialize (G 0%Q). rewrite Q2R_0, Rminus_0_r, Rabs_R0, Rplus_0_r in G. specialize (G (Rle_refl _)).
      eapply Rle_trans; [|exact G]. simpl. unfold there. destruct (mutual e); simpl; rewrite ?Q2R_0, ?Rabs_R0;
        repeat (destruct (Nat.eqb _ _)); lra. }
  lra.
Qed.

(** * The clock comes to every number *)
Lemma clock_comes T rho1 k t0 h : 0 < T -> 0 < rho1 -> 0 < k -> t0 < T -> 0 < h -> exists t, t0 <= t < T /\ clock T rho1 k t = clock T rho1 k t0 + h.
Proof.
  intros HT H1 Hk Ht Hh. set (t' := T - (T - t0) * exp (- (h / k))).
  assert (E1 : exp (- (h / k)) < 1).
  { rewrite <- exp_0. apply exp_increasing. assert (0 < h / k) by (apply Rdiv_lt_0_compat; lra). lra. }
  pose proof (exp_pos (- (h / k))) as E0. assert (L : t0 < t' < T) by (unfold t'; split; nra).
  assert (Ek : clock T rho1 k t' = clock T rho1 k t0 + h + rho1 * (t' - t0)).
  { unfold clock. assert (Q : T / (T - t') = T / (T - t0) * exp (h / k)).
    { unfold t'. replace (T - (T - (T - t0) * exp (- (h / k)))) with ((T - t0) * exp (- (h / k))) by ring.
      rewrite exp_Ropp. pose proof (exp_pos (h / k)). field. lra. }
    rewrite Q, ln_mult, ln_exp; [field; lra|apply Rdiv_lt_0_compat; lra|apply exp_pos]. }
  destruct (Ranalysis5.IVT_interv (fun t => clock T rho1 k t - (clock T rho1 k t0 + h)) t0 t') as [t [Bt Et]]; [|lra|lra| |].
  - intros a Ha. apply continuity_pt_filterlim. apply (continuous_minus (clock T rho1 k) (fun _ => clock T rho1 k t0 + h)); [|apply continuous_const].
    apply @ex_derive_continuous. eexists. apply (clock_derive T rho1 k HT). lra.
  - rewrite Ek. assert (0 < rho1 * (t' - t0)) by (apply Rmult_lt_0_compat; lra). lra.
  - exists t. split; lra.
Qed.

(** * Along a motion *)
Definition asum (A : list (nat * bool)) (f : nat * bool -> R) : R := fold_right (fun a r => f a + r) 0 A.
Lemma asum_le A f g : (forall a, In a A -> f a <= g a) -> asum A f <= asum A g.
Proof.
  induction A as [|a A IH]; intros H; simpl; [lra|]. specialize (IH ltac:(intros; apply H; right; assumption)).
  pose proof (H a ltac:(left; reflexivity)). lra.
Qed.
Lemma asum_lin A a f b g : asum A (fun i => a * f i + b * g i) = a * asum A f + b * asum A g.
Proof. induction A as [|i A IH]; simpl; [ring|]. rewrite IH. ring. Qed.
Lemma asum_pos A f : (forall b, In b A -> 0 <= f b) -> 0 <= asum A f.
Proof.
  induction A as [|c A IH]; intros H; simpl; [lra|]. specialize (IH ltac:(intros; apply H; right; assumption)).
  pose proof (H c ltac:(left; reflexivity)). lra.
Qed.
Lemma asum_one A f a : (forall b, In b A -> 0 <= f b) -> In a A -> f a <= asum A f.
Proof.
  induction A as [|b A IH]; intros H Ha; [destruct Ha|]. simpl.
  destruct Ha as [->|Ha].
  - pose proof (asum_pos A f ltac:(intros; apply H; right; assumption)). lra.
  - specialize (IH ltac:(intros; apply H; right; assumption) Ha). pose proof (H b ltac:(left; reflexivity)). lra.
Qed.
Lemma asum_some A f m : (0 < length A)%nat -> INR (length A) * m <= asum A f -> exists a, In a A /\ m <= f a.
Proof.
  intros HA H. destruct (Classical_Prop.classic (exists a, In a A /\ m <= f a)) as [Y|No]; [exact Y|exfalso].
  assert (K : asum A f < INR (length A) * m); [|lra]. clear H.
  induction A as [|a A IH]; [simpl in HA; lia|]. change (length (a :: A)) with (S (length A)). rewrite S_INR. simpl asum.
  assert (La : f a < m) by (apply Rnot_le_lt; intros L; apply No; exists a; split; [left; reflexivity|exact L]).
  destruct A as [|a' A]; [simpl; lra|].
  assert (K : asum (a' :: A) f < INR (length (a' :: A)) * m).
  { apply IH; [simpl; lia|]. intros [b [Hb L]]. apply No. exists b. split; [right; exact Hb|exact L]. }
  lra.
Qed.
Lemma asum_derive A (f : nat * bool -> R -> R) (l : nat * bool -> R) t : (forall a, In a A -> is_derive (f a) t (l a)) ->
  is_derive (fun u => asum A (fun a => f a u)) t (asum A l).
Proof.
  induction A as [|a A IH]; intros H; simpl; [apply (is_derive_const 0)|].
  apply (is_derive_plus (f a) (fun u => asum A (fun a => f a u))); [apply H; left; reflexivity|apply IH; intros; apply H; right; assumption].
Qed.
Lemma asum_cont A (f : nat * bool -> R -> R) t : (forall a, In a A -> continuous (f a) t) -> continuous (fun u => asum A (fun a => f a u)) t.
Proof.
  induction A as [|a A IH]; intros H; simpl; [apply continuous_const|].
  apply (continuous_plus (f a) (fun u => asum A (fun a => f a u))); [apply H; left; reflexivity|apply IH; intros; apply H; right; assumption].
Qed.
Lemma sg_one b : sg b = 1 \/ sg b = -1.
Proof. destruct b; auto. Qed.

Section Kernel.
Variables (F : family) (P : part).
Let c := frame F.
Let n := order c.
Let T := deadline c.
Let rho := Q2R (rho1 c).
Let C := its_agents P.
Hypothesis Hframe : check_frame F = true.
Hypothesis Hmodes : forallb (check_mode F) (modes F) = true.
Hypothesis Hpart : check_part F P = true.
Hypothesis Hbasis : check_pivots F P = true.
Hypothesis Hdepends : becomes P <> Depends.
Local Notation s := (s c).
Lemma in_n i : In i C -> (i < n)%nat.
Proof. apply (agents_in F P Hbasis). Qed.
Lemma later X Sl t0 t1 : switches_from F X Sl t0 -> t0 <= t1 < T -> switches_from F X Sl t1.
Proof. intros [HM [A B]] Ht. split; [exact HM|]. split; [fold c T in A |- *; lra|]. intros t i H Hi. apply B; [fold c T in H |- *; lra|exact Hi]. Qed.

Section Motion.
Variables (X Sl : R -> nat -> R) (t0 : R) (z : nat -> R).
Hypothesis HM : switches_from F X Sl t0.
(** what is left to the state at rest *)
Let x (t : R) (i : nat) : R := X (Rmax t0 t) i - comb P z i.
Lemma x_cont t i : t0 <= t < T -> (i < n)%nat -> continuous (fun u => x u i) t.
Proof.
  intros Ht Hi. apply (continuous_minus (fun u => X (Rmax t0 u) i) (fun _ => comb P z i)); [|apply continuous_const].
  apply (Y_cont F X Sl t0 HM t i Ht Hi).
Qed.
Lemma x_moves : exists D : nat -> R, forall t, t0 < t < T -> (forall j, t <> D j) -> exists m w, In m (modes F) /\ admits (ties m) w /\
  forall i, (i < n)%nat -> is_derive (fun u => x u i) t (- (gain T rho (k c) t * member (ties m) w (x t) i)).
Proof.
  destruct (Y_moves F X Sl t0 HM) as [D HD]. exists D. intros t Ht Hj. destruct (HD t Ht Hj) as [m [w [Hm [Hw E]]]].
  exists m, w. split; [exact Hm|]. split; [exact Hw|]. intros i Hi.
  assert (EL : member (ties m) w (x t) i = member (ties m) w (X (Rmax t0 t)) i).
  { rewrite (member_same _ w (x t) (fun j => X (Rmax t0 t) j + (-1) * comb P z j)) by (intros; unfold x; ring).
    rewrite member_plus, (member_scal _ w (-1) (comb P z)), (comb_rest F P Hmodes Hpart Hbasis Hdepends m w z i Hm Hw). ring. }
  rewrite EL, <- Rminus_0_r. apply (is_derive_minus (fun u => X (Rmax t0 u) i) (fun _ => comb P z i)); [apply (E i Hi)|apply (is_derive_const (comb P z i))].
Qed.
Variable M : R.
Hypothesis H0 : forall i, In i C -> Rabs (x t0 i) <= M.
Theorem stays t i : t0 <= t < T -> In i C -> Rabs (x t i) <= M.
Proof.
  intros Ht Hi0. destruct (positive_ F Hframe) as [P1 [P2 P3]]. fold c in P1, P2, P3. fold T rho in P1, P2.
  assert (M0 : 0 <= M) by (eapply Rle_trans; [apply Rabs_pos|apply (H0 i Hi0)]).
  set (q := fun i => if in_dec Nat.eq_dec i C then 1 else 0).
  set (g := fun j : nat => if (j <? n)%nat then 1 else -1). set (ix := fun j => if (j <? n)%nat then j else (j - n)%nat).
  set (f := fun j u => g j * (q (ix j) * x u (ix j))).
  assert (Hix : forall j, (j < n + n)%nat -> (ix j < n)%nat) by (intros j Hj; unfold ix; destruct (Nat.ltb_spec j n); lia).
  assert (Hg : forall j, g j = 1 \/ g j = -1) by (intros j; unfold g; destruct (j <? n)%nat; auto).
  destruct x_moves as [D HD].
  assert (G : forall j u, t0 <= u < T -> (j < n + n)%nat -> f j u <= M).
  { intros j u Hu Hj. apply (never_grows (n + n) f t0 T D); [| | |exact Hu|exact Hj]; clear j u Hu Hj.
    - intros j u Hj Hu. unfold f. apply (continuous_mult (fun _ => g j)); [apply continuous_const|].
      apply (continuous_mult (fun _ => q (ix j))); [apply continuous_const|]. apply x_cont; auto.
    - intros u Hu Hj j Hjn. destruct (HD u Hu Hj) as [m [w [Hm [Hw E]]]]. set (v := ix j). assert (Hv : (v < n)%nat) by (apply Hix; exact Hjn).
      exists (g j * (q v * - (gain T rho (k c) u * member (ties m) w (x u) v))). split.
      + unfold f. fold v. apply is_derive_scal. apply is_derive_scal. apply (E v Hv).
      + intros Mx. unfold q. destruct (in_dec Nat.eq_dec v C) as [A|_]; [|lra].
        assert (Fj : f j u = g j * x u v) by (unfold f, q; fold v; destruct (in_dec Nat.eq_dec v C); [ring|contradiction]).
        assert (All : forall i, In i C -> Rabs (x u i) <= g j * x u v).
        { intros i' Hi. pose proof (in_n i' Hi) as Hin. pose proof (Mx i' ltac:(lia)) as M1. pose proof (Mx (i' + n)%nat ltac:(lia)) as M2.
          rewrite Fj in M1, M2. unfold f, g, ix, q in M1, M2. destruct (Nat.ltb_spec i' n); [|lia]. destruct (Nat.ltb_spec (i' + n) n); [lia|].
          replace (i' + n - n)%nat with i' in M2 by lia. destruct (in_dec Nat.eq_dec i' C); [|contradiction].
          change (if (j <? n)%nat then 1 else -1) with (g j) in M1, M2. apply Rabs_le. lra. }
        pose proof (draws n C (ties m) (ties_ok F Hmodes m Hm) (fun e He => part_ties F P Hpart m e Hm He) w (x u) v (g j) _ Hw (Hg j) A All) as K.
        pose proof (spare_pos (smallest (ties m)) (g j * x u v) (g j) (x u) v (Hg j)) as S.
        destruct (modes_claim F Hmodes m Hm) as [Ee _]. rewrite <- Ee in S.
        specialize (S ltac:(intros e He Et; apply All; apply (part_inside F P Hmodes Hpart m e Hm He); rewrite Et; exact A)). rewrite Ee in S.
        pose proof (gain_pos T rho (k c) P2 P3 u ltac:(lra)) as Gp. set (L := member (ties m) w (x u) v) in *.
        assert (0 <= g j * L) by lra. assert (0 <= gain T rho (k c) u * (g j * L)) by (apply Rmult_le_pos; lra). lra.
    - intros j Hj. unfold f, q. destruct (in_dec Nat.eq_dec (ix j) C) as [A|_]; [|rewrite Rmult_0_l, Rmult_0_r; exact M0].
      rewrite Rmult_1_l. apply sign_at_most; [apply Hg|apply H0; exact A]. }
  pose proof (in_n i Hi0) as Hin. pose proof (G i t Ht ltac:(lia)) as G1. pose proof (G (i + n)%nat t Ht ltac:(lia)) as G2.
  unfold f, g, ix, q in G1, G2. destruct (Nat.ltb_spec i n); [|lia]. destruct (Nat.ltb_spec (i + n) n); [lia|].
  replace (i + n - n)%nat with i in G2 by lia. destruct (in_dec Nat.eq_dec i C); [|contradiction]. apply Rabs_le. lra.
Qed.

(** how far signed agents are from the farthest *)
Variable D : R.
Hypothesis HD : forall m, In m (modes F) -> heft (ties m) <= D.
Theorem grows (A : list (nat * bool)) (kap : R) : (forall a, In a A -> In (fst a) C) -> 0 <= kap ->
  (forall t m, t0 <= t < T -> In m (modes F) ->
     kap * exp (- (D * (s t - s t0))) <= asum A (fun a => spare (edges (mandatory m)) M (sg (snd a)) (x t) (fst a))) ->
  forall t, t0 <= t < T -> exp (- (D * (s t - s t0))) * (asum A (fun a => M - sg (snd a) * x t0 (fst a)) + kap * (s t - s t0)) <=
    asum A (fun a => M - sg (snd a) * x t (fst a)).
Proof.
  intros HA Hk HS t1 Ht1. destruct (positive_ F Hframe) as [P1 [P2 P3]]. fold c in P1, P2, P3. fold T rho in P1, P2.
  pose proof HM as [_ [Ht0 _]]. fold c T in Ht0.
  set (u := fun a t => M - sg (snd a) * x t (fst a)). set (y := fun t => asum A (fun a => u a t)). set (e := fun t => exp (D * s t)).
  assert (Ee : forall t, t < T -> is_derive e t (D * gain T rho (k c) t * e t)).
  { intros t Ht. unfold e. evar_last. { apply is_derive_comp; [apply is_derive_exp|]. apply is_derive_scal. apply (clock_derive T rho (k c) P1 t Ht). }
    unfold scal; simpl; unfold mult; simpl. change (clock T rho (k c) t) with (s t). ring. }
  assert (Es : forall t, t < T -> is_derive s t (gain T rho (k c) t)) by (intros t Ht; apply (clock_derive T rho (k c) P1 t Ht)).
  assert (Pe : forall t, 0 < e t) by (intros; apply exp_pos).
  assert (Eq : forall t, exp (- (D * (s t - s t0))) = e t0 / e t).
  { intros t. unfold e, Rdiv. rewrite <- exp_Ropp, <- exp_plus. f_equal. ring. }
  assert (K : kap * e t0 * s t1 - e t1 * y t1 <= kap * e t0 * s t0 - e t0 * y t0).
  { destruct x_moves as [Dx HDx]. apply (falls (fun t => kap * e t0 * s t - e t * y t) t0 T Dx); [| |exact Ht1].
    - intros t Ht. apply (continuous_minus (fun t => kap * e t0 * s t) (fun t => e t * y t)).
      + apply (continuous_mult (fun _ => kap * e t0)); [apply continuous_const|]. apply @ex_derive_continuous. eexists. apply Es. lra.
      + apply (continuous_mult e y); [apply @ex_derive_continuous; eexists; apply Ee; lra|]. apply (asum_cont A u). intros a Ha.
        apply (continuous_minus (fun _ => M) (fun t => sg (snd a) * x t (fst a))); [apply continuous_const|].
        apply (continuous_mult (fun _ => sg (snd a))); [apply continuous_const|]. apply x_cont; [exact Ht|apply in_n; apply HA; exact Ha].
    - intros t Ht Hj. destruct (HDx t Ht Hj) as [m [w [Hm [Hw E]]]]. set (g := gain T rho (k c) t) in *. set (L := member (ties m) w (x t)) in *.
      set (dy := asum A (fun a => g * (sg (snd a) * L (fst a)))).
      exists (kap * e t0 * g - (D * g * e t * y t + e t * dy)). split.
      + apply (is_derive_minus (fun t => kap * e t0 * s t) (fun t => e t * y t)); [apply is_derive_scal; apply Es; lra|].
        apply (is_derive_mult e y); [apply Ee; lra| |intros; apply Rmult_comm]. unfold y, dy. apply (asum_derive A u). intros a Ha. unfold u.
        replace (g * (sg (snd a) * L (fst a))) with (0 - sg (snd a) * - (g * L (fst a))) by ring.
        apply (is_derive_minus (fun _ => M) (fun t => sg (snd a) * x t (fst a))); [apply (is_derive_const M)|].
        apply is_derive_scal. apply E. apply in_n. apply HA. exact Ha.
      + specialize (HS t m ltac:(lra) Hm). rewrite Eq in HS. pose proof (gain_pos T rho (k c) P2 P3 t ltac:(lra)) as Gp. fold g in Gp.
        assert (Z : asum A (fun a => spare (edges (mandatory m)) M (sg (snd a)) (x t) (fst a)) <=
          asum A (fun a => 1 * (sg (snd a) * L (fst a)) + D * u a t)).
        { apply asum_le. intros a Ha. destruct (modes_claim F Hmodes m Hm) as [Em _]. rewrite Em, Rmult_1_l.
          pose proof (draws n C (ties m) (ties_ok F Hmodes m Hm) (fun e He => part_ties F P Hpart m e Hm He) w (x t) (fst a) (sg (snd a)) M Hw
            (sg_one (snd a)) (HA a Ha) (fun i Hi => stays t i ltac:(lra) Hi)) as Q. fold L in Q.
          pose proof (sign_at_most (sg (snd a)) (x t (fst a)) M (sg_one _) (stays t (fst a) ltac:(lra) (HA a Ha))) as U.
          assert (heft (ties m) * u a t <= D * u a t) by (apply Rmult_le_compat_r; [unfold u; lra|apply HD; exact Hm]). unfold u in *. lra. }
        rewrite asum_lin in Z. fold (y t) in Z. rewrite Rmult_1_l in Z.
        assert (Edy : dy = g * asum A (fun a => sg (snd a) * L (fst a))).
        { unfold dy. rewrite <- (Rplus_0_r (g * _)). rewrite <- (Rmult_0_l (asum A (fun _ => 0))). rewrite <- asum_lin.
          clear. induction A as [|a A IH]; simpl; [reflexivity|]. rewrite IH. ring. }
        rewrite Edy. set (sl := asum A (fun a => sg (snd a) * L (fst a))) in *. pose proof (Pe t) as Pt.
        assert (Q : kap * e t0 <= e t * (sl + D * y t)).
        { apply (Rmult_le_reg_r (/ e t)); [apply Rinv_0_lt_compat; exact Pt|].
          replace (e t * (sl + D * y t) * / e t) with (sl + D * y t) by (field; lra). unfold Rdiv in HS. lra. }
        assert (g * (kap * e t0) <= g * (e t * (sl + D * y t))) by (apply Rmult_le_compat_l; lra). lra. }
  rewrite Eq. change (asum A (fun a => M - sg (snd a) * x t0 (fst a))) with (y t0). change (asum A (fun a => M - sg (snd a) * x t1 (fst a))) with (y t1).
  pose proof (Pe t1) as Pt. apply (Rmult_le_reg_l (e t1)); [exact Pt|].
  replace (e t1 * (e t0 / e t1 * (y t0 + kap * (s t1 - s t0)))) with (e t0 * y t0 + kap * e t0 * (s t1 - s t0)) by (field; lra). lra.
Qed.
End Motion.
End Kernel.
