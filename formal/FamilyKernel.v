(** The common kernel theorem: under every signal a family whose mandatory graphs have one kernel comes to rest in it, with a
    rate that the family alone decides. Agents that are nearly as far from a state at rest as the farthest one get fewer with
    every window of the clock, until all are nearer, or until they form a closed set whose edges agree with their signs:
    then another state at rest is nearer. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Claims Mean Table Dominance Rest Wide FamilyCertificate FamilyFlow
  FamilyChecker FamilySound FamilyMotion FamilyRows FamilyRest FamilyNear.
Open Scope R_scope.

Lemma turned w b e : w = Q2R (wt e) -> sg b * w = Rabs w * sg (turn e b).
Proof.
  intros ->. unfold turn. destruct (Rlt_dec 0 (Q2R (wt e))) as [L|L].
  - rewrite Rabs_right by lra. ring.
  - rewrite Rabs_left1 by lra. destruct b; simpl; ring.
Qed.

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
Lemma clock_up t t' : t < t' < T -> s t < s t'.
Proof.
  intros Ht. destruct (positive_ F Hframe) as [P1 [P2 P3]]. fold c in P1, P2, P3. fold T rho in P1, P2.
  destruct (MVT_gen s t t' (gain T rho (k c))) as [v [Hv E]].
  - intros u Hu. rewrite Rmax_right in Hu by lra. apply (clock_derive T rho (k c) P1). lra.
  - intros u Hu. rewrite Rmax_right in Hu by lra. apply continuity_pt_filterlim. apply @ex_derive_continuous. eexists.
    apply (clock_derive T rho (k c) P1). lra.
  - rewrite Rmax_right in Hv by lra. pose proof (gain_pos T rho (k c) P2 P3 v ltac:(lra)) as G.
    assert (0 < gain T rho (k c) v * (t' - t)) by (apply Rmult_lt_0_compat; lra). lra.
Qed.
Lemma clock_upto t t' : t' < T -> t < T -> s t <= s t' -> t <= t'.
Proof. intros A B H. apply Rnot_lt_le. intros L. pose proof (clock_up t' t ltac:(lra)). lra. Qed.

Definition near (X : R -> nat -> R) (t : R) (z : nat -> R) (M : R) : Prop := forall i, In i C -> Rabs (X t i - comb P z i) <= M.
Lemma near_stays X Sl t0 z M t : switches_from F X Sl t0 -> near X t0 z M -> t0 <= t < T -> near X t z M.
Proof.
  intros HM H0 Ht i Hi. pose proof (stays F P Hframe Hmodes Hpart Hbasis Hdepends X Sl t0 z HM M) as K. cbv zeta beta in K.
  fold c T C in K. specialize (K ltac:(intros j Hj; rewrite Rmax_left by lra; apply H0; exact Hj) t i Ht Hi).
  rewrite Rmax_right in K by lra. exact K.
Qed.

Variables D w0 N : R.
Hypothesis HD : forall m, In m (modes F) -> heft (ties m) <= D.
Hypothesis Hw0 : 0 < w0.
Hypothesis Hw : forall m e, In m (modes F) -> In e (edges (mandatory m)) -> w0 <= Rabs (Q2R (wt e)).
Hypothesis HN : 0 < N.
Definition th := exp (- D) * (w0 / (w0 + N)).
Lemma th_ok : 0 < th /\ th <= exp (- D) /\ th * N <= exp (- D) * w0 /\ th <= 1.
Proof.
  pose proof (exp_pos (- D)) as E. assert (Q : 0 < w0 / (w0 + N)) by (apply Rdiv_lt_0_compat; lra).
  assert (Q1 : w0 / (w0 + N) <= 1) by (apply (Rmult_le_reg_r (w0 + N)); [lra|]; unfold Rdiv; rewrite Rmult_assoc, Rinv_l by lra; lra).
  assert (Q2 : w0 / (w0 + N) * N <= w0).
  { apply (Rmult_le_reg_r (w0 + N)); [lra|]. replace (w0 / (w0 + N) * N * (w0 + N)) with (w0 * N) by (field; lra). nra. }
  assert (D0 : 0 <= D).
  { destruct (modes F) as [|m l] eqn:Em; [exfalso; unfold check_frame in Hframe; rewrite Em in Hframe; discriminate|].
    eapply Rle_trans; [apply (heft_pos (ties m))|apply HD; left; reflexivity]. }
  assert (E1 : exp (- D) <= 1).
  { destruct D0 as [D0|<-]; [|rewrite Ropp_0, exp_0; lra]. left. rewrite <- exp_0. apply exp_increasing. lra. }
  unfold th. split; [apply Rmult_lt_0_compat; assumption|]. split; [nra|]. split; [|nra].
  rewrite Rmult_assoc. apply Rmult_le_compat_l; lra.
Qed.

(** one window after the other *)
Section Window.
Variables (X Sl : R -> nat -> R) (t0 : R) (z : nat -> R) (M : R).
Hypothesis HM : switches_from F X Sl t0.
Hypothesis H0 : near X t0 z M.
Let u (b : bool) (t : R) (i : nat) := M - sg b * (X t i - comb P z i).
Lemma u_pos b t i : t0 <= t < T -> In i C -> 0 <= u b t i.
Proof.
  intros Ht Hi. pose proof (sign_at_most (sg b) _ M (sg_one b) (near_stays X Sl t0 z M t HM H0 Ht i Hi)). unfold u. lra.
Qed.
Lemma sources m e t : t0 <= t < T -> In m (modes F) -> In e (edges (mandatory m)) -> In (tgt e) C -> Rabs (X t (src e) - comb P z (src e)) <= M.
Proof. intros Ht Hm He Hi. apply (near_stays X Sl t0 z M t HM H0 Ht). apply (part_inside F P Hmodes Hpart m e Hm He). exact Hi. Qed.
Lemma grown A kap : (forall a, In a A -> In (fst a) C) -> 0 <= kap ->
  (forall t m, t0 <= t < T -> In m (modes F) ->
     kap * exp (- (D * (s t - s t0))) <= asum A (fun a => spare (edges (mandatory m)) M (sg (snd a)) (fun i => X t i - comb P z i) (fst a))) ->
  forall t, t0 <= t < T -> exp (- (D * (s t - s t0))) * (asum A (fun a => u (snd a) t0 (fst a)) + kap * (s t - s t0)) <=
    asum A (fun a => u (snd a) t (fst a)).
Proof.
  intros HA Hk HS t Ht. pose proof (grows F P Hframe Hmodes Hpart Hbasis Hdepends X Sl t0 z HM M) as G. cbv zeta beta in G. fold c T C in G.
  specialize (G ltac:(intros j Hj; rewrite Rmax_left by lra; apply H0; exact Hj) D HD A kap HA Hk).
  specialize (G ltac:(intros v m Hv Hm; rewrite (Rmax_right t0 v) by lra; apply HS; assumption) t Ht).
  rewrite (Rmax_right t0 t), (Rmax_left t0 t0) in G by lra. exact G.
Qed.
Lemma keeps b i t : t0 <= t < T -> In i C -> exp (- (D * (s t - s t0))) * u b t0 i <= u b t i.
Proof.
  intros Ht Hi. pose proof (grown [(i, b)] 0) as G. cbn [asum fold_right fst snd] in G.
  specialize (G ltac:(intros a [<-|[]]; exact Hi) (Rle_refl 0)). rewrite <- (Rplus_0_r (u b t i)).
  eapply Rle_trans; [|apply G; [|exact Ht]]; [right; ring|]. intros v m Hv Hm. rewrite Rmult_0_l, Rplus_0_r. apply spare_pos; [apply sg_one|].
  intros e He Et. apply (sources m e v Hv Hm He). rewrite Et. exact Hi.
Qed.
Variables (A : list (nat * bool)) (eta : R).
Hypothesis Heta : 0 < eta <= 1.
Hypothesis HM0 : 0 < M.
Hypothesis HA : forall i b, In (i, b) A -> In i C /\ ~ In (i, negb b) A.
Hypothesis Hout : forall i b, In i C -> ~ In (i, b) A -> eta * M <= u b t0 i.
(** agents in [A] form a closed set that agrees with their signs in some mode: another state at rest is nearer *)
Lemma nearer m : In m (modes F) -> (forall i b e, In (i, b) A -> In e (edges (mandatory m)) -> tgt e = i -> In (src e, turn e b) A) ->
  exists z', near X t0 z' ((1 - eta / 2) * M).
Proof.
  intros Hm HC. destruct (extends F P Hmodes Hpart Hbasis Hdepends m Hm A HA HC) as [q [Q1 Q2]].
  exists (fun i => z i + eta / 2 * M * q i). intros i Hi. specialize (H0 i Hi). specialize (Q1 i Hi). apply Rabs_le_between in H0, Q1.
  unfold comb at 1. rewrite tot_plus, tot_scal. fold (comb P z i) (comb P q i).
  pose proof (Hout i true Hi) as O1. pose proof (Hout i false Hi) as O2. unfold u, sg in O1, O2. set (v := X t0 i - comb P z i) in *.
  replace (X t0 i - (comb P z i + eta / 2 * M * comb P q i)) with (v - eta / 2 * M * comb P q i) by (unfold v; ring).
  assert (B : - (eta / 2 * M) <= eta / 2 * M * comb P q i <= eta / 2 * M).
  { assert (0 <= eta / 2 * M) by (apply Rmult_le_pos; lra). split; nra. }
  assert (EM : eta * M <= M) by nra.
  apply Rabs_le. destruct (in_dec node_dec (i, true) A) as [I1|N1]; [|destruct (in_dec node_dec (i, false) A) as [I2|N2]].
  - rewrite (Q2 i true I1). specialize (O2 (proj2 (HA i true I1))). simpl sg. lra.
  - rewrite (Q2 i false I2). specialize (O1 N1). simpl sg. lra.
  - specialize (O1 N1). specialize (O2 N2). lra.
Qed.
(** if it is closed in none, an agent leaves it within a window *)
Lemma leaves t1 : INR (length A) <= N -> t0 <= t1 < T -> s t1 = s t0 + 1 -> (forall m, In m (modes F) -> exists i b e, In (i, b) A /\
    In e (edges (mandatory m)) /\ tgt e = i /\ ~ In (src e, turn e b) A) ->
  (forall i b, In i C -> ~ In (i, b) A -> th * eta * M <= u b t1 i) /\ exists a, In a A /\ th * eta * M <= u (snd a) t1 (fst a).
Proof.
  intros HL Ht1 Es HC. destruct th_ok as [Th0 [Th1 [Th2 _]]].
  assert (K : forall t i b, t0 <= t < T -> In i C -> ~ In (i, b) A -> eta * M * exp (- (D * (s t - s t0))) <= u b t i).
  { intros t i b Ht Hi Hn. eapply Rle_trans; [|apply (keeps b i t Ht Hi)]. rewrite Rmult_comm.
    apply Rmult_le_compat_l; [left; apply exp_pos|apply Hout; assumption]. }
  assert (Em : 0 < eta * M) by (apply Rmult_lt_0_compat; lra).
  assert (Ex : exp (- (D * (s t1 - s t0))) = exp (- D)) by (f_equal; rewrite Es; ring).
  split.
  - intros i b Hi Hn. eapply Rle_trans; [|apply (K t1 i b Ht1 Hi Hn)]. rewrite Ex. nra.
  - assert (LA : (0 < length A)%nat).
    { destruct (modes F) as [|m l] eqn:Emo; [exfalso; unfold check_frame in Hframe; rewrite Emo in Hframe; discriminate|].
      destruct (HC m ltac:(left; reflexivity)) as [i [b [e [Ha _]]]]. destruct A; [destruct Ha|simpl; lia]. }
    apply (asum_some A (fun a => u (snd a) t1 (fst a)) _ LA).
    pose proof (grown A (w0 * (eta * M))) as G. specialize (G ltac:(intros [i b] Hi; apply (HA i b Hi)) ltac:(apply Rmult_le_pos; lra)).
    eapply Rle_trans; [|apply G; [|exact Ht1]].
    + rewrite Ex, Es. replace (s t0 + 1 - s t0) with 1 by ring.
      assert (S0 : 0 <= asum A (fun a => u (snd a) t0 (fst a))).
      { apply asum_pos. intros [i b] Hi. apply u_pos; [lra|apply (HA i b Hi)]. }
      pose proof (exp_pos (- D)) as E0. assert (L : INR (length A) * (th * eta * M) <= exp (- D) * (w0 * (eta * M))); [|nra].
      apply Rle_trans with (th * N * (eta * M)); [|nra]. replace (INR (length A) * (th * eta * M)) with (INR (length A) * (th * (eta * M))) by ring.
      replace (th * N * (eta * M)) with (N * (th * (eta * M))) by ring. apply Rmult_le_compat_r; [apply Rmult_le_pos; lra|exact HL].
    + intros t m Ht Hm. destruct (HC m Hm) as [i [b [e [Ha [He [Et Hn]]]]]]. destruct (HA i b Ha) as [Hi _].
      assert (Hs : In (src e) C) by (apply (part_inside F P Hmodes Hpart m e Hm He); rewrite Et; exact Hi).
      eapply Rle_trans; [|apply (asum_one A _ (i, b)); [|exact Ha]]; cbn [fst snd].
      * eapply Rle_trans; [|apply spare_one with (e := e); [apply sg_one| |exact He|exact Et]];
          [|intros f Hf Ef; apply (sources m f t Ht Hm Hf); rewrite Ef; exact Hi].
        cbv beta. rewrite <- (Rmult_assoc (sg b)), (turned _ b e eq_refl). specialize (K t (src e) (turn e b) Ht Hs Hn). pose proof (Hw m e Hm He) as W.
        unfold u in K. set (x := X t (src e) - comb P z (src e)) in *. set (w := Rabs (Q2R (wt e))) in *.
        pose proof (exp_pos (- (D * (s t - s t0)))) as E0. set (ex := exp (- (D * (s t - s t0)))) in *.
        replace (w0 * (eta * M) * ex) with (w0 * (eta * M * ex)) by ring.
        replace (w * M - w * sg (turn e b) * x) with (w * (M - sg (turn e b) * x)) by ring.
        assert (0 <= eta * M * ex) by (apply Rmult_le_pos; lra). apply Rmult_le_compat; lra.
      * intros [i' b'] Hi'. cbn [fst snd]. apply spare_pos; [apply sg_one|]. intros f Hf Ef. apply (sources m f t Ht Hm Hf). rewrite Ef.
        apply (HA i' b' Hi').
Qed.
End Window.
Lemma th_pow j : 0 < th ^ j <= 1.
Proof. destruct th_ok as [A [_ [_ B]]]. induction j as [|j IH]; simpl; [lra|]. split; [apply Rmult_lt_0_compat; lra|nra]. Qed.
Lemma windows j : forall A X Sl t1 z M eta, (length A <= j)%nat -> INR (length A) <= N -> switches_from F X Sl t1 -> near X t1 z M ->
  0 < eta <= 1 -> 0 < M -> (forall i b, In (i, b) A -> In i C /\ ~ In (i, negb b) A) ->
  (forall i b, In i C -> ~ In (i, b) A -> eta * M <= M - sg b * (X t1 i - comb P z i)) ->
  forall t2, t1 <= t2 < T -> s t1 + INR j <= s t2 -> exists z', near X t2 z' ((1 - th ^ j * eta / 2) * M).
Proof.
  induction j as [|j IH]; intros A X Sl t1 z M eta HL HL' HM H0 Heta HM0 HA Hout t2 Ht2 Hs;
    (destruct (Classical_Prop.classic (exists m, In m (modes F) /\ forall i b e, In (i, b) A -> In e (edges (mandatory m)) -> tgt e = i ->
      In (src e, turn e b) A)) as [[m [Hm HC]]|No];
    [destruct (nearer X t1 z M H0 A eta Heta HM0 HA Hout m Hm HC) as [z' Hz']; exists z'; intros i Hi;
     eapply Rle_trans; [apply (near_stays X Sl t1 z' _ t2 HM Hz' Ht2 i Hi)|]; apply Rmult_le_compat_r; [lra|];
     match goal with |- context [th ^ ?q] => pose proof (th_pow q) end; nra|]).
  - exfalso. destruct A; [|simpl in HL; lia]. destruct (modes F) as [|m l] eqn:Em.
    + unfold check_frame in Hframe. rewrite Em in Hframe. discriminate.
    + apply No. exists m. split; [left; reflexivity|]. intros i b e [].
  - assert (HC : forall m, In m (modes F) -> exists i b e, In (i, b) A /\ In e (edges (mandatory m)) /\ tgt e = i /\ ~ In (src e, turn e b) A).
    { intros m Hm. apply Classical_Prop.NNPP. intros K. apply No. exists m. split; [exact Hm|]. intros i b e Ha He Et.
      apply Classical_Prop.NNPP. intros Hn. apply K. exists i, b, e. auto. }
    rewrite S_INR in Hs. destruct (positive_ F Hframe) as [P1 [P2 P3]]. fold c in P1, P2, P3. fold T rho in P1, P2. pose proof (pos_INR j) as J0.
    destruct (clock_comes T rho (k c) t1 1 P1 P2 P3 ltac:(lra) ltac:(lra)) as [t' [Ht' Es]]. change (s t' = s t1 + 1) in Es.
    pose proof (clock_upto t' t2 ltac:(lra) ltac:(lra) ltac:(lra)) as L.
    destruct (leaves X Sl t1 z M HM H0 A eta Heta HM0 HA Hout t' HL' Ht' Es HC) as [O [a [Ha La]]]. destruct th_ok as [Th0 [_ [_ Th1]]].
    pose proof (remove_length_lt node_dec A a Ha) as RL.
    destruct (IH (remove node_dec a A) X Sl t' z M (th * eta)) with (t2 := t2) as [z' Hz']; try assumption; try lra.
    + lia.
    + eapply Rle_trans; [|exact HL']. apply le_INR. lia.
    + apply (later F X Sl t1 t' HM Ht').
    + apply (near_stays X Sl t1 z M t' HM H0 Ht').
    + split; [apply Rmult_lt_0_compat; lra|nra].
    + intros i b Hi. apply in_remove in Hi as [Hi _]. destruct (HA i b Hi) as [A1 A2]. split; [exact A1|]. intros K. apply in_remove in K as [K _]. exact (A2 K).
    + intros i b Hi Hn. destruct (node_dec (i, b) a) as [<-|Ne]; [exact La|]. apply (O i b Hi). intros K. apply Hn. apply in_in_remove; assumption.
    + exists z'. simpl pow. replace (th * th ^ j * eta / 2) with (th ^ j * (th * eta) / 2) by (unfold Rdiv; ring). exact Hz'.
Qed.

(** * Contraction, again and again *)
Let j0 := S (2 * length C).
Hypothesis HNC : INR j0 <= N.
Definition part_of := th ^ j0 / 2.
Lemma part_ok : 0 < part_of <= 1 / 2.
Proof. unfold part_of. pose proof (th_pow j0). lra. Qed.
Lemma contracts X Sl t1 z M t2 : switches_from F X Sl t1 -> 0 <= M -> near X t1 z M -> t1 <= t2 < T -> s t1 + INR j0 <= s t2 ->
  exists z', near X t2 z' ((1 - part_of) * M).
Proof.
  intros HM M0 H0 Ht Hs. destruct M0 as [M0|<-].
  2:{ exists z. rewrite Rmult_0_r. apply (near_stays X Sl t1 z 0 t2 HM H0 Ht). }
  set (A := filter (fun a => if Rlt_dec 0 (sg (snd a) * (X t1 (fst a) - comb P z (fst a))) then true else false) (list_prod C [true; false])).
  assert (HA : forall i b, In (i, b) A <-> In i C /\ 0 < sg b * (X t1 i - comb P z i)).
  { intros i b. unfold A. rewrite filter_In, in_prod_iff. cbn [fst snd].
    destruct (Rlt_dec 0 (sg b * (X t1 i - comb P z i))) as [L|L]; split; intros [K1 K2]; try discriminate; try contradiction.
    - split; [apply K1|exact L].
    - split; [split; [exact K1|destruct b; simpl; auto]|reflexivity]. }
  assert (LA : (length A <= 2 * length C)%nat).
  { unfold A. assert (Lf : forall (f : nat * bool -> bool) l, (length (filter f l) <= length l)%nat).
    { intros f l. induction l as [|a l IH]; simpl; [lia|]. destruct (f a); simpl; lia. }
    eapply Nat.le_trans; [apply Lf|]. rewrite prod_length. simpl. lia. }
  destruct (windows j0 A X Sl t1 z M 1) with (t2 := t2) as [z' Hz']; try assumption; try lra.
  - unfold j0. lia.
  - eapply Rle_trans; [|exact HNC]. apply le_INR. unfold j0. lia.
  - intros i b Hi. apply HA in Hi as [Hi L]. split; [exact Hi|]. intros K. apply HA in K as [_ K]. destruct b; simpl in *; lra.
  - intros i b Hi Hn. assert (~ 0 < sg b * (X t1 i - comb P z i)) by (intros L; apply Hn; apply HA; auto). lra.
  - exists z'. unfold part_of. replace (th ^ j0 / 2) with (th ^ j0 * 1 / 2) by (unfold Rdiv; ring). exact Hz'.
Qed.
Lemma iterates p : forall X Sl t1 z M t2, switches_from F X Sl t1 -> 0 <= M -> near X t1 z M -> t1 <= t2 < T ->
  s t1 + INR p * INR j0 <= s t2 -> exists z', near X t2 z' ((1 - part_of) ^ p * M).
Proof.
  induction p as [|p IH]; intros X Sl t1 z M t2 HM M0 H0 Ht Hs.
  - exists z. simpl. rewrite Rmult_1_l. apply (near_stays X Sl t1 z M t2 HM H0 Ht).
  - destruct (positive_ F Hframe) as [P1 [P2 P3]]. fold c in P1, P2, P3. fold T rho in P1, P2. pose proof part_ok as Hd.
    assert (J0 : 0 < INR j0) by (apply lt_0_INR; unfold j0; lia). rewrite S_INR in Hs.
    destruct (clock_comes T rho (k c) t1 (INR j0) P1 P2 P3 ltac:(lra) J0) as [t' [Ht' Es]]. change (s t' = s t1 + INR j0) in Es.
    assert (PJ : 0 <= INR p * INR j0) by (apply Rmult_le_pos; [apply pos_INR|lra]).
    pose proof (clock_upto t' t2 ltac:(lra) ltac:(lra) ltac:(lra)) as L.
    destruct (contracts X Sl t1 z M t' HM M0 H0 Ht' ltac:(lra)) as [z1 Hz1].
    destruct (IH X Sl t' z1 ((1 - part_of) * M) t2 (later F X Sl t1 t' HM Ht')) as [z' Hz']; try assumption; try lra.
    + apply Rmult_le_pos; lra.
    + exists z'. simpl pow. replace ((1 - part_of) * (1 - part_of) ^ p * M) with ((1 - part_of) ^ p * ((1 - part_of) * M)) by ring. exact Hz'.
Qed.
Definition speed := part_of / INR j0.
Definition left_over t0 M t := exp part_of * exp (- (speed * (s t - s t0))) * M.
Lemma speed_pos : 0 < speed.
Proof. pose proof part_ok. apply Rdiv_lt_0_compat; [lra|]. apply lt_0_INR. unfold j0. lia. Qed.
Lemma stays_near X Sl t0 z M t : switches_from F X Sl t0 -> 0 <= M -> near X t0 z M -> t0 <= t < T -> exists z', near X t z' (left_over t0 M t).
Proof.
  intros HM M0 H0 Ht. assert (J0 : 0 < INR j0) by (apply lt_0_INR; unfold j0; lia). pose proof part_ok as Hd.
  assert (S0 : 0 <= s t - s t0).
  { destruct (proj1 Ht) as [L|E]; [pose proof (clock_up t0 t ltac:(lra)); lra|rewrite E; lra]. }
  destruct (nfloor_ex ((s t - s t0) / INR j0)) as [p [Hp1 Hp2]].
  { apply Rmult_le_pos; [exact S0|left; apply Rinv_0_lt_compat; exact J0]. }
  assert (Ej : (s t - s t0) / INR j0 * INR j0 = s t - s t0) by (field; lra).
  destruct (iterates p X Sl t0 z M t HM M0 H0 Ht) as [z' Hz'].
  { apply (Rmult_le_compat_r (INR j0)) in Hp1; [|lra]. lra. }
  exists z'. intros i Hi. eapply Rle_trans; [apply (Hz' i Hi)|]. unfold left_over. apply Rmult_le_compat_r; [exact M0|].
  rewrite <- exp_plus. apply Rle_trans with (exp (- part_of * INR p)).
  - clear Hp1 Hp2 Hz'. induction p as [|p IH]; [simpl; rewrite Rmult_0_r, exp_0; lra|]. rewrite S_INR. cbn [pow].
    replace (- part_of * (INR p + 1)) with (- part_of + - part_of * INR p) by ring. rewrite exp_plus.
    apply Rmult_le_compat; [lra|apply pow_le; lra| |exact IH]. pose proof (exp_ineq1_le (- part_of)). lra.
  - assert (L : - part_of * INR p <= part_of + - (speed * (s t - s t0))).
    { unfold speed. replace (part_of / INR j0 * (s t - s t0)) with (part_of * ((s t - s t0) / INR j0)) by (field; lra). nra. }
    destruct L as [L|L]; [left; apply exp_increasing; exact L|rewrite L; apply Rle_refl].
Qed.
End Kernel.

(** * The limit *)
Lemma heft_most l : exists D, forall m, In m l -> heft (ties m) <= D.
Proof.
  induction l as [|m l [D HD]]; [exists 0; intros m []|]. exists (heft (ties m) + Rabs D). pose proof (Rle_abs D). pose proof (Rabs_pos D).
  intros m' [<-|Hm]; [lra|]. specialize (HD m' Hm). pose proof (heft_pos (ties m)). lra.
Qed.
Lemma least_size (l : list edge) : (forall e, In e l -> Q2R (wt e) <> 0) -> exists w, 0 < w /\ forall e, In e l -> w <= Rabs (Q2R (wt e)).
Proof.
  induction l as [|e l IH]; intros H; [exists 1; split; [lra|intros e []]|]. destruct (IH ltac:(intros; apply H; right; assumption)) as [w [W0 W]].
  pose proof (Rabs_pos_lt _ (H e ltac:(left; reflexivity))) as E. exists (Rmin w (Rabs (Q2R (wt e)))). split; [apply Rmin_pos; assumption|].
  intros f [<-|Hf]; [apply Rmin_r|]. eapply Rle_trans; [apply Rmin_l|apply W; exact Hf].
Qed.
Lemma comb_small P i : exists B, 0 <= B /\ forall v m, (forall b, In b (still P) -> Rabs (v (fst b)) <= m) -> Rabs (comb P v i) <= B * m.
Proof.
  unfold comb. induction (still P) as [|b l [B [B0 HB]]]; [exists 0; split; [lra|intros; simpl; rewrite Rabs_R0; lra]|].
  exists (Rabs (Q2R (nth i (snd b) 0%Q)) + B). split; [pose proof (Rabs_pos (Q2R (nth i (snd b) 0%Q))); lra|]. intros v m Hv. simpl.
  eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_mult, Rmult_plus_distr_r. apply Rplus_le_compat.
  - apply Rmult_le_compat_l; [apply Rabs_pos|apply Hv; left; reflexivity].
  - apply HB. intros; apply Hv; right; assumption.
Qed.

Section Limit.
Variables (F : family) (P : part).
Let c := frame F.
Let T := deadline c.
Let C := its_agents P.
Hypothesis Hframe : check_frame F = true.
Hypothesis Hmodes : forallb (check_mode F) (modes F) = true.
Hypothesis Hpart : check_part F P = true.
Hypothesis Hbasis : check_pivots F P = true.
Hypothesis Hdepends : becomes P <> Depends.
Local Notation s := (s c).
Lemma vanish t K r v : 0 < r -> t < T -> (forall t', t <= t' < T -> v <= K * exp (- (r * s t'))) -> v <= 0.
Proof.
  intros Hr Ht H. apply Rnot_lt_le. intros Hv. destruct (positive_ F Hframe) as [P1 [P2 P3]]. fold c in P1, P2, P3. fold T in P1.
  set (a := K * exp (- (r * s t))). assert (Ha : v <= a) by (apply H; lra).
  destruct (clock_comes T (Q2R (rho1 c)) (k c) t (a / (v * r)) P1 P2 P3 Ht) as [t' [Ht' Es]].
  { apply Rdiv_lt_0_compat; [lra|apply Rmult_lt_0_compat; lra]. }
  change (s t' = s t + a / (v * r)) in Es. specialize (H t' Ht').
  assert (E : exp (- (r * s t')) * exp (a / v) = exp (- (r * s t))).
  { rewrite <- exp_plus. f_equal. rewrite Es. field. lra. }
  pose proof (exp_ineq1_le (a / v)) as G. pose proof (exp_pos (a / v)) as G0.
  assert (L : v * exp (a / v) <= a). { unfold a at 2. rewrite <- E, <- Rmult_assoc. apply Rmult_le_compat_r; lra. }
  assert (v * (1 + a / v) <= a) by (eapply Rle_trans; [apply Rmult_le_compat_l; [lra|exact G]|exact L]).
  replace (v * (1 + a / v)) with (v + a) in H0 by (field; lra). lra.
Qed.
Theorem common_kernel : kernel_claim F P.
Proof.
  intros _. cbv zeta. destruct (heft_most (modes F)) as [D HD].
  destruct (least_size (flat_map (fun m => edges (mandatory m)) (modes F))) as [w [W0 W]].
  { intros e He. apply in_flat_map in He as [m [Hm He]]. apply (part_inside F P Hmodes Hpart m e Hm He). }
  assert (Hw : forall m e, In m (modes F) -> In e (edges (mandatory m)) -> w <= Rabs (Q2R (wt e))).
  { intros m e Hm He. apply W. apply in_flat_map. exists m. auto. }
  set (N := INR (S (2 * length C))). assert (HN : 0 < N) by (apply lt_0_INR; lia).
  set (E := left_over F P D w N). set (r := speed P D w N). set (d := part_of P D w N).
  assert (Hr : 0 < r) by (apply (speed_pos F P Hframe Hmodes D w N HD W0 Hw HN)).
  exists (2 * exp d), r. split; [exact Hr|]. intros X Sl HM.
  assert (Em : forall t0 M t, E t0 M t = exp d * exp (r * s t0) * M * exp (- (r * s t))).
  { intros t0 M t. unfold E, left_over. fold c d r. replace (- (r * (s t - s t0))) with (r * s t0 + - (r * s t)) by ring. rewrite exp_plus. ring. }
  assert (Near : forall t0 M t, switches_from F X Sl t0 -> 0 <= M -> (forall j, In j C -> Rabs (xi P (X t0) j) <= M) -> t0 <= t < T ->
    exists z, near P X t z (E t0 M t)).
  { intros t0 M t H0 HM0 HX Ht. apply (stays_near F P Hframe Hmodes Hpart Hbasis Hdepends D w N HD W0 Hw HN (Rle_refl _) X Sl t0 (X t0) M t H0 HM0); [|exact Ht].
    intros j Hj. rewrite <- xi_comb. apply HX. exact Hj. }
  assert (Moves : forall t0 M t t' i, switches_from F X Sl t0 -> 0 <= M -> (forall j, In j C -> Rabs (xi P (X t0) j) <= M) -> t0 <= t <= t' ->
    t' < T -> In i C -> Rabs (X t' i - X t i) <= 2 * E t0 M t).
  { intros t0 M t t' i H0 HM0 HX Ht Ht' Hi. destruct (Near t0 M t H0 HM0 HX ltac:(lra)) as [z Hz].
    pose proof (Hz i Hi) as A. pose proof (near_stays F P Hframe Hmodes Hpart Hbasis Hdepends X Sl t z _ t'
      (later F X Sl t0 t H0 ltac:(fold c T; lra)) Hz ltac:(fold c T; lra) i Hi) as B.
    apply Rabs_le_between in A, B. apply Rabs_le. lra. }
  destruct (settles_family F Hframe X Sl HM) as [ta Ha]. pose proof Ha as [_ [Hta _]]. fold c T in Hta.
  assert (Big : exists M, 0 <= M /\ forall j, In j C -> Rabs (xi P (X ta) j) <= M).
  { generalize C. intros l. induction l as [|j l [M [M0 HMl]]]; [exists 0; split; [lra|intros j []]|]. exists (Rabs (xi P (X ta) j) + M).
    pose proof (Rabs_pos (xi P (X ta) j)). split; [lra|]. intros j' [<-|Hj]; [lra|]. specialize (HMl j' Hj). lra. }
  destruct Big as [Ma [Ma0 HMa]]. set (Ea := E ta Ma).
  assert (Ea0 : forall t, 0 <= Ea t).
  { intros t. unfold Ea. rewrite Em. repeat apply Rmult_le_pos; try (left; apply exp_pos). exact Ma0. }
  assert (Lim : forall i, In i C -> exists v, forall t, ta <= t < T -> Rabs (X t i - v) <= 2 * Ea t).
  { intros i Hi.
    assert (K : forall t t', ta <= t < T -> ta <= t' < T -> X t' i - 2 * Ea t' <= X t i + 2 * Ea t).
    { intros t t' Ht Ht'. pose proof (Ea0 t). pose proof (Ea0 t'). destruct (Rle_dec t t') as [L|L].
      - pose proof (Moves ta Ma t t' i Ha Ma0 HMa ltac:(lra) ltac:(lra) Hi) as B. fold Ea in B. apply Rabs_le_between in B. lra.
      - pose proof (Moves ta Ma t' t i Ha Ma0 HMa ltac:(lra) ltac:(lra) Hi) as B. fold Ea in B. apply Rabs_le_between in B. lra. }
    destruct (completeness (fun v => exists t, ta <= t < T /\ v = X t i - 2 * Ea t)) as [v [U L]].
    - exists (X ta i + 2 * Ea ta). intros v [t [Ht ->]]. apply K; [lra|exact Ht].
    - exists (X ta i - 2 * Ea ta), ta. split; [lra|reflexivity].
    - exists v. intros t Ht. apply Rabs_le. split.
      + assert (v <= X t i + 2 * Ea t); [|lra]. apply L. intros u [t' [Ht' ->]]. apply K; assumption.
      + assert (X t i - 2 * Ea t <= v); [|lra]. apply U. exists t. split; [exact Ht|reflexivity]. }
  destruct (finite_choice 0 (order c) (fun i v => In i C -> forall t, ta <= t < T -> Rabs (X t i - v) <= 2 * Ea t)) as [y Hy].
  { intros i _. destruct (in_dec Nat.eq_dec i C) as [I|I]; [|exists 0; intros; contradiction]. destruct (Lim i I) as [v Hv]. exists v. auto. }
  pose proof (agents_in F P Hbasis) as HC. destruct (basis_parts F P Hbasis Hdepends) as [_ [HP _]]. fold C in HC, HP. fold c in HC.
  exists y. split.
  - intros i Hi. split.
    + destruct (comb_small P i) as [B [B0 HB]]. set (K := (1 + B) * (3 * (exp d * exp (r * s ta) * Ma))).
      assert (V : Rabs (xi P y i) <= 0).
      { apply (vanish ta K r _ Hr ltac:(lra)). intros t Ht. destruct (Near ta Ma t Ha Ma0 HMa Ht) as [z Hz]. fold Ea in Hz.
        assert (A : forall j, In j C -> Rabs (y j - comb P z j) <= 3 * Ea t).
        { intros j Hj. pose proof (Hz j Hj) as A1. pose proof (Hy j (HC j Hj) Hj t Ht) as A2. apply Rabs_le_between in A1, A2. apply Rabs_le. lra. }
        assert (Ex : xi P y i = (y i - comb P z i) + -1 * comb P (fun j => y j + -1 * comb P z j) i).
        { rewrite xi_comb. unfold comb at 3. rewrite tot_plus, tot_scal. fold (comb P y i) (comb P (comb P z) i).
          rewrite (comb_comb F P Hbasis Hdepends). ring. }
        rewrite Ex. eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_mult, (Rabs_left (-1)) by lra.
        specialize (HB (fun j => y j + -1 * comb P z j) (3 * Ea t)).
        specialize (HB ltac:(intros b Hb; cbv beta; replace (y (fst b) + -1 * comb P z (fst b)) with (y (fst b) - comb P z (fst b)) by ring; apply A; apply HP; exact Hb)).
        specialize (A i Hi). assert (EK : K * exp (- (r * s t)) = (1 + B) * (3 * Ea t)) by (unfold K, Ea; rewrite Em; ring). rewrite EK. lra. }
      apply no_size. exact V.
    + apply (near_limit F Hframe (fun t => X t i) X Sl ta (y i) (2 * (exp d * exp (r * s ta) * Ma)) (2 * r) ltac:(lra) Ha). intros t Ht.
      eapply Rle_trans; [apply (Hy i (HC i Hi) Hi t Ht)|]. unfold Ea. rewrite Em. fold c. replace (2 * r / 2 * s t) with (r * s t) by field. right. ring.
  - intros t0 t M i H0 Ht Hi HX. fold C in Hi, HX. assert (M0 : 0 <= M) by (eapply Rle_trans; [apply Rabs_pos|apply (HX i Hi)]).
    assert (V : Rabs (X t i - y i) - 2 * E t0 M t <= 0).
    { fold c T in Ht. apply (vanish (Rmax t ta) (2 * (exp d * exp (r * s ta) * Ma)) r _ Hr); [apply Rmax_lub_lt; lra|]. intros t' Ht'.
      pose proof (Rmax_l t ta). pose proof (Rmax_r t ta).
      pose proof (Moves t0 M t t' i H0 M0 HX ltac:(lra) ltac:(lra) Hi) as A. pose proof (Hy i (HC i Hi) Hi t' ltac:(lra)) as B.
      unfold Ea in B. rewrite Em in B. replace (X t i - y i) with (- (X t' i - X t i) + (X t' i - y i)) by ring.
      pose proof (Rabs_triang (- (X t' i - X t i)) (X t' i - y i)) as Tr. rewrite Rabs_Ropp in Tr. lra. }
    unfold E, left_over in V. fold c d r in V. fold c. lra.
Qed.
End Limit.
