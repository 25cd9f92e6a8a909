(** The theorem for a family: what is proved of every motion under every signal. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Claims Input Slide Exist Peak Reach Main Rest Table Wide FamilyCertificate FamilyFlow
  FamilyChecker FamilySound FamilyMotion FamilyRows FamilyKernel FamilyMoves FamilyBox FamilyEnds.
Open Scope R_scope.

(** * Motions exist *)
Lemma pulls_lipschitz e K w : Rabs w <= K -> lipschitz (4 * K) (pulls e w).
Proof.
  intros H. replace (4 * K) with (2 * K + 2 * K) by ring. apply lipschitz_plus; [apply lipschitz_edge; exact H|].
  destruct (mutual e); [apply lipschitz_edge; exact H|]. apply (lipschitz_le 0); [|exact lipschitz_zero].
  pose proof (Rabs_pos w). lra.
Qed.
Lemma member_lipschitz l : exists K, 0 <= K /\ forall w, admits l w -> lipschitz K (member l w).
Proof.
  induction l as [|e l [K [HK IH]]]; [exists 0; split; [lra|intros; exact lipschitz_zero]|].
  set (B := Rmax (- Q2R (bottom e)) (Q2R (top e))). exists (4 * Rabs B + K).
  split; [pose proof (Rabs_pos B); lra|]. intros w Hw.
  apply (lipschitz_plus _ _ (pulls e (w O)) (member l (shift w))); [|apply IH; intros j; apply (Hw (S j))].
  apply pulls_lipschitz. specialize (Hw O e eq_refl). pose proof (Rle_abs B). pose proof (Rmax_l (- Q2R (bottom e)) (Q2R (top e))).
  pose proof (Rmax_r (- Q2R (bottom e)) (Q2R (top e))). fold B in H0, H1. apply Rabs_le. lra.
Qed.
Lemma modes_lipschitz l : exists K, 0 <= K /\ forall m w, In m l -> admits (ties m) w -> lipschitz K (member (ties m) w).
Proof.
  induction l as [|m l [K [HK IH]]]; [exists 0; split; [lra|intros m w []]|].
  destruct (member_lipschitz (ties m)) as [L [HL H]]. exists (L + K). split; [lra|]. intros m' w [<-|Hm] Hw.
  - apply (lipschitz_le L); [lra|]. apply H. exact Hw.
  - apply (lipschitz_le K); [lra|]. apply IH; assumption.
Qed.
Lemma member_exists F : modes F <> [] -> forallb (check_mode F) (modes F) = true -> exists m w, In m (modes F) /\ admits (ties m) w.
Proof.
  destruct (modes F) as [|m l]; [contradiction|]. intros _ H. exists m. simpl in H. apply andb_prop in H as [H _]. unfold check_mode in H.
  cbv zeta in H. repeat apply andb_prop in H as [H _]. rewrite forallb_forall in H.
  set (w := fun j => match nth_error (ties m) j with Some e => Q2R (bottom e) | None => 0 end).
  exists w. split; [left; reflexivity|]. intros j e Hj. unfold w. rewrite Hj. split; [lra|].
  specialize (H e (nth_error_In _ _ Hj)). unfold check_tie, lo, hi in H. apply andb_prop in H as [_ H]. apply Qle_bool_iff in H.
  apply Qle_Rle. destruct (positive e); [exact H|]. rewrite <- (Qopp_involutive (bottom e)), <- (Qopp_involutive (top e)).
  apply Qopp_le_compat. exact H.
Qed.
Theorem family_motions_exist F : check_protocol (frame F) = true -> modes F <> [] -> forallb (check_mode F) (modes F) = true -> existence_claim F.
Proof.
  intros HP HM HC. unfold existence_claim. cbv zeta. set (c := frame F) in *. split; [apply member_exists; assumption|]. intros m w D x0 s0 Hmw HD H0. destruct (slides_exist c s0 HP H0) as [S [HS [S0 CS]]].
  destruct (modes_lipschitz (modes F)) as [K [HK L]].
  destruct (driven (order c) (fun t => member (ties (m t)) (w t)) (deadline c) (Q2R (rho1 c)) (k c) S x0 K) as [X [X0 [CX DX]]];
    [apply (T_pos c HP)|exact HK|intros t _; apply L; apply Hmw|intros; apply CS|].
  assert (O : forall t, 0 < t < deadline c -> (forall j, t <> D j) -> obeys F X S t (m t) (w t)).
  { intros t Ht Hj i Hi. apply DX; [exact Ht|exact Hi|]. intros x. apply HD; assumption. }
  exists X, S. split; [split; [exact HS|split; [exact CX|]]|split; [|exact O]].
  - exists D. intros t Ht Hj. exists (m t), (w t). split; [apply Hmw|]. split; [apply Hmw|]. apply O; assumption.
  - intros i Hi. split; [apply X0; exact Hi|apply S0].
Qed.

Section Main.
Variable F : family.
Let c := frame F.
Let n := order c.
Let T := deadline c.
Let rho := Q2R (rho1 c).
Hypothesis Hframe : check_frame F = true.
Hypothesis Hmodes : forallb (check_mode F) (modes F) = true.
Local Notation decays := (FamilyMotion.decays F).
Local Notation sizes := (FamilyMotion.sizes F).
Local Notation means_too := (FamilyMotion.means_too F).
(** * Forms *)
Lemma in_combine {A B} (l : list A) (l' : list B) x : length l = length l' -> In x l -> exists y, In (x, y) (combine l l').
Proof.
  revert l'. induction l as [|a l IH]; intros [|b l'] L H; try discriminate L; [destruct H|].
  destruct H as [<-|H]; [exists b; left; reflexivity|]. destruct (IH l' ltac:(injection L; auto) H) as [y Hy]. exists y. right. exact Hy.
Qed.
Lemma map_fst_combine {A B} (l : list A) : forall l' : list B, length l = length l' -> map fst (combine l l') = l.
Proof. induction l as [|a l IH]; intros [|b l'] L; try discriminate L; [reflexivity|]. simpl. rewrite IH by (injection L; auto). reflexivity. Qed.
Lemma form_bound b h A : by_ b = Form A -> check_family_form F b h A = true ->
  decays b /\ sizes b /\ means_too b /\ forall x, exists a, 0 <= a /\ below b a x.
Proof.
  intros EA H. unfold check_family_form in H. cbv zeta in H. fold c n in H. set (q := quotient_of n (about b) A) in *.
  apply andb_prop in H as [H H5]. apply andb_prop in H as [H H4]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  apply Nat.eqb_eq in H2, H3. rewrite forallb_forall in H4. destruct (factor_mod n (qsw q) (qfw q) (qF q)) as [r|] eqn:Er; [|discriminate].
  apply andb_prop in H5 as [H5 H6]. rewrite forallb_forall in H6.
  destruct (quotient_parts n (about b) A H1) as [Q1 [Q2 [Q3 Q4]]]. fold q in Q1, Q2, Q3, Q4.
  pose proof (quotient_ok n (about b) A H1) as QV. fold q in QV. apply IZR_lt in Q2.
  assert (SI : forall m w x a, In m (modes F) -> admits (ties m) w -> 0 <= a -> below b a x ->
    (forall i, In i (its_agents (about b)) -> sq (member (ties m) w x i) <= Q2R (nth i (inputs b) 0%Q) * a) /\
    forall v, In v (means b) -> sq (qdot (fst v) (member (ties m) w x)) <= Q2R (snd v) * a).
  { intros m w x a Hm Hw Ha H0. unfold below in H0. rewrite EA in H0.
    destruct (in_combine _ (roots h) m ltac:(symmetry; exact H3) Hm) as [rs Hrs]. specialize (H6 _ Hrs). cbn [fst snd] in H6.
    apply (inputs_ok n (about b) A H1 r Er b (ties m) rs eq_refl (ties_ok F Hmodes m Hm) H6 w x a Ha H0 Hw). }
  split; [|split; [|split]].
  - intros X Sl t0 t a HM Ht Ha H0. unfold below in *. rewrite EA in *.
    assert (K : bil (qF q) (X t) (X t) <= exp (- (Q2R (decay b) * (s c t - s c t0))) * bil (qF q) (X t0) (X t0)).
    { apply (form_decays F Hframe X Sl t0 HM (qF q) (Q2R (decay b)) Q4); [|exact Ht]. intros m w x Hm Hw.
      destruct (in_combine _ (multipliers h) m ltac:(symmetry; exact H2) Hm) as [ms Hms]. specialize (H4 _ Hms). cbn [fst snd] in H4.
      apply andb_prop in H4 as [L H4]. apply andb_prop in L as [L B]. apply Nat.eqb_eq in L. apply Qle_R in B.
      pose proof (decay_ok n _ _ _ _ _ H4 Q4) as K. rewrite (map_fst_combine _ _ L) in K.
      eapply Rle_trans; [|apply K; [apply (ties_ok F Hmodes); exact Hm|exact Hw]]. apply Rmult_le_compat_r; [|exact B].
      apply (factor_mod_ok _ _ _ _ _ Er x). }
    rewrite !QV in K. set (e := exp _) in *. assert (Pe : 0 < e) by apply exp_pos. apply (Rmult_le_reg_l (IZR (qm q))); [exact Q2|].
    eapply Rle_trans; [exact K|].
    replace (IZR (qm q) * (e * a)) with (e * (IZR (qm q) * a)) by ring. apply Rmult_le_compat_l; [lra|]. apply Rmult_le_compat_l; lra.
  - intros x a i Ha H0 Hi. split; [|intros m w Hm Hw; apply (SI m w x a Hm Hw Ha H0); exact Hi].
    unfold below in H0. rewrite EA in H0. apply (offs_ok n (about b) A H1 r Er (offs b) H5 x a i Hi H0).
  - intros x a v Ha H0 Hv m w Hm Hw. apply (SI m w x a Hm Hw Ha H0). exact Hv.
  - intros x. exists (qbil A (xi (about b) x) (xi (about b) x)). split; [apply (value_pos n (about b) A H1 r Er)|].
    unfold below. rewrite EA. lra.
Qed.
Lemma bound_parts b h : check_bound F b h = true -> (forall i, In i (its_agents (about b)) -> (i < n)%nat) /\
  (forall v, In v (still (about b)) -> In (fst v) (its_agents (about b))) /\ decays b /\ sizes b /\ means_too b /\ forall x, exists a, 0 <= a /\ below b a x.
Proof.
  intros H. unfold check_bound in H. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2]. rewrite forallb_forall in H1, H2.
  split; [intros i Hi; apply Nat.ltb_lt; apply H1; exact Hi|]. split; [intros v Hv; apply mem_In; apply H2; exact Hv|].
  assert (HA : forall i, In i (its_agents (about b)) -> (i < n)%nat) by (intros i Hi; apply Nat.ltb_lt; apply H1; exact Hi).
  assert (HP : forall v, In v (still (about b)) -> In (fst v) (its_agents (about b))) by (intros v Hv; apply mem_In; apply H2; exact Hv).
  destruct (by_ b) as [A|d|p] eqn:E; try discriminate; [apply (form_bound b h A E H3)|].
  split; [apply (rows_decay F Hframe Hmodes b d E HA HP H3)|]. split; [apply (rows_size F Hmodes b d E H3)|].
  split; [|apply (rows_value F Hmodes b d E H3)]. intros x a v _ _ Hv. rewrite (rows_means F b d H3) in Hv. destruct Hv.
Qed.
Theorem bounds_claim b h : check_bound F b h = true -> bound_claim F b.
Proof.
  intros H. destruct (bound_parts b h H) as [_ [_ [H3 [H4 [H5 _]]]]]. split; [exact H3|]. split; [exact H4|exact H5].
Qed.

(** * Parts *)
Theorem parts_claim P u : check_pivots F P = true -> check_depends F P u = true -> check_part F P = true -> part_claim F P.
Proof.
  intros HV HW HPart. pose proof HPart as H. revert H. unfold check_part. cbv zeta. set (C := its_agents P). set (es := every_edge F). intros H.
  apply andb_prop in H as [H H5]. apply andb_prop in H as [H H4]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  split; [|split].
  - assert (K : forall j, In j C -> linked es (hd O C) j).
    { intros j Hj. rewrite forallb_forall in H2. specialize (H2 j Hj). apply reached_ok in H2 as [st [[<-|[]] L]]. exact L. }
    intros i j Hi. split.
    + intros Hj. apply (path_trans _ i (hd O C) j); [apply linked_back; apply K; exact Hi|apply K; exact Hj].
    + intros L. exact (linked_in es C H3 i j L Hi).
  - intros ND m Hm. destruct (becomes P); try (exfalso; apply ND; reflexivity); rewrite forallb_forall in H4; specialize (H4 m Hm);
      apply andb_prop in H4 as [L R]; apply Nat.eqb_eq in L; (split; [exact L|]); intros w p v i Hw Hv Hi; rewrite forallb_forall in R;
      apply (rest_ok F Hmodes (common_of (still P)) m v Hm (R _ Hv) w i Hw).
  - destruct (becomes P) eqn:EB.
    + destruct (still P); [reflexivity|discriminate].
    + destruct (still P) as [|[p v] [|]]; try discriminate. exists p, v. split; [reflexivity|]. intros i Hi.
      rewrite forallb_forall in H5. specialize (H5 i Hi). apply Qeq_R in H5. rewrite Q2R_mult in H5. unfold sq. rewrite H5. unfold Q2R. simpl. lra.
    + apply andb_prop in H5 as [HN H5]. split; [intros E; rewrite E in HN; discriminate|]. intros m Hm.
      rewrite forallb_forall in H5. specialize (H5 m Hm). destruct (owned m P) as [|C0 [|]]; try discriminate. exists C0. reflexivity.
    + apply andb_prop in H5 as [HN H5]. split; [intros E; rewrite E in HN; discriminate|]. apply existsb_exists in H5 as [m [Hm H5]]. destruct (owned m P) as [|C0 [|C1 l]] eqn:E; try discriminate. exists m, C0, C1, l. auto.
    + apply (depends_ok F P u Hmodes HPart HV HW EB).
Qed.

(** * The input *)
Variable hs : list hint.
Hypothesis Hbounds : ((length (bounds F) =? length hs)%nat && forallb (fun bh => check_bound F (fst bh) (snd bh)) (combine (bounds F) hs)) = true.
Lemma bound_of b : In b (bounds F) -> exists h, check_bound F b h = true.
Proof.
  intros Hb. apply andb_prop in Hbounds as [L H]. apply Nat.eqb_eq in L. rewrite forallb_forall in H.
  destruct (in_combine _ hs b L Hb) as [h Hh]. exists h. apply (H _ Hh).
Qed.
Lemma fast_ok b : fast F b = true -> 2 <= k c * Q2R (decay b).
Proof.
  intros H. unfold fast in H. cbv zeta in H. fold c in H. apply Qle_R in H. rewrite !Q2R_mult in H. fold (k c) in H.
  replace (Q2R 2) with 2 in H by (unfold Q2R; simpl; lra). exact H.
Qed.
(** gain times what a fast bound lets the agents move *)
Lemma inputs_fall b h i X Sl t0 a t m w : check_bound F b h = true -> fast F b = true -> In i (its_agents (about b)) ->
  switches_from F X Sl t0 -> 0 <= a -> below b a (X t0) -> t0 <= t < T -> In m (modes F) -> admits (ties m) w ->
  sq (gain T rho (k c) t * member (ties m) w (X t) i) <=
    sq (rho + k c / T) * (Q2R (nth i (inputs b) 0%Q) * a * exp (Q2R (decay b) * s c t0)).
Proof.
  intros Hb Hf Hi HM Ha H0 Ht Hm Hw. destruct (bound_parts b h Hb) as [_ [_ [HD [HS _]]]]. destruct (positive_ F Hframe) as [P1 [P2 P3]].
  apply fast_ok in Hf. pose proof HM as [_ [Ht0 _]]. fold c T in Ht0. set (r := Q2R (decay b)) in *.
  pose proof (gain_decay T rho (k c) r t P1 P2 P3 Hf ltac:(lra)) as G. specialize (HD X Sl t0 t a HM Ht Ha H0). fold r in HD.
  set (e := exp (- (r * (s c t - s c t0)))) in *. assert (Pe : 0 < e) by apply exp_pos.
  destruct (HS (X t) (e * a) i ltac:(apply Rmult_le_pos; lra) HD Hi) as [_ K]. specialize (K m w Hm Hw).
  set (q := Q2R (nth i (inputs b) 0%Q)) in *. set (u := member (ties m) w (X t) i) in *. set (g := gain T rho (k c) t) in *.
  assert (Ee : e = exp (r * s c t0) * exp (- (r * clock T rho (k c) t))) by (unfold e; rewrite <- exp_plus; f_equal; unfold s; fold T rho; lra).
  assert (Q0 : 0 <= q * a).
  { pose proof (sq_pos u). assert (0 <= e * (q * a)) by lra. apply (Rmult_le_reg_l e); [exact Pe|]. lra. }
  set (e0 := exp (r * s c t0)) in *. assert (P0 : 0 < e0) by apply exp_pos.
  replace (sq (g * u)) with (sq g * sq u) by (unfold sq; ring).
  eapply Rle_trans; [apply Rmult_le_compat_l; [apply sq_pos|exact K]|]. rewrite Ee.
  replace (sq g * (q * (e0 * exp (- (r * clock T rho (k c) t)) * a))) with (sq g * exp (- (r * clock T rho (k c) t)) * (q * a * e0)) by ring.
  apply Rmult_le_compat_r; [apply Rmult_le_pos; lra|exact G].
Qed.
Theorem stays_ok : check_stays F = true -> stays F = true -> forall X S t0, switches_from F X S t0 ->
  exists K, forall t i m w, t0 <= t < T -> (i < n)%nat -> In m (modes F) -> admits (ties m) w ->
    Rabs (gain T rho (k c) t * member (ties m) w (X t) i) <= K.
Proof.
  intros H Hst X Sl t0 HM. unfold check_stays in H. rewrite Hst in H. cbn [negb orb] in H. fold c n in H. rewrite forallb_forall in H.
  assert (E : forall i, (i < n)%nat -> exists K, forall t m w, t0 <= t < T -> In m (modes F) -> admits (ties m) w ->
    sq (gain T rho (k c) t * member (ties m) w (X t) i) <= K).
  { intros i Hi. specialize (H i ltac:(apply in_seq; lia)). apply orb_prop in H as [H|H].
    - exists 0. intros t m w _ Hm _. rewrite (unmoved_ok F i m w (X t) H Hm). unfold sq. lra.
    - apply existsb_exists in H as [b [Hb H]]. apply andb_prop in H as [H1 H2]. apply mem_In in H2. destruct (bound_of b Hb) as [h Hh].
      destruct (bound_parts b h Hh) as [_ [_ [_ [_ [_ HV]]]]]. destruct (HV (X t0)) as [a [Ha H0]].
      exists (sq (rho + k c / T) * (Q2R (nth i (inputs b) 0%Q) * a * exp (Q2R (decay b) * s c t0))). intros t m w Ht Hm Hw.
      apply (inputs_fall b h i X Sl t0 a t m w); assumption. }
  destruct (finite_choice 0 n (fun i K => forall t m w, t0 <= t < T -> In m (modes F) -> admits (ties m) w ->
    sq (gain T rho (k c) t * member (ties m) w (X t) i) <= K) E) as [K HK].
  exists (fold_right (fun i a => Rabs (K i) + a) 0 (seq 0 n) + 1). intros t i m w Ht Hi Hm Hw. specialize (HK i Hi t m w Ht Hm Hw).
  set (u := _ * _) in *.
  assert (G : forall l, 0 <= fold_right (fun i a => Rabs (K i) + a) 0 l /\ (In i l -> Rabs (K i) <= fold_right (fun i a => Rabs (K i) + a) 0 l)).
  { induction l as [|j l [I1 I2]]; simpl; [split; [lra|intros []]|]. pose proof (Rabs_pos (K j)). split; [lra|].
    intros [->|Hj]; [lra|]. specialize (I2 Hj). lra. }
  destruct (G (seq 0 n)) as [_ G1]. specialize (G1 ltac:(apply in_seq; lia)). set (M := fold_right _ _ _) in *.
  pose proof (Rle_abs (K i)). pose proof (Rabs_pos (K i)). unfold sq in HK. apply Rabs_le. split; nra.
Qed.

(** * From the initial state *)
Lemma dotQ_ok l x : forall i, Q2R (dotQ l x i) = qdot l (fun j => Q2R (x (i + j)%nat)).
Proof.
  induction l as [|a l IH]; intros i; cbn [dotQ qdot]; [apply Q2R_0|]. rewrite Qred_R, Q2R_plus, Q2R_mult, IH, Nat.add_0_r.
  f_equal. apply qdot_ext. intros j _. unfold shift. f_equal. f_equal. lia.
Qed.
Lemma bilQ_ok A x : forall i, Q2R (bilQ A x i) = qbil A (fun j => Q2R (x (i + j)%nat)) (fun j => Q2R (x j)).
Proof.
  induction A as [|r A IH]; intros i; cbn [bilQ qbil]; [apply Q2R_0|]. rewrite Qred_R, Q2R_plus, Q2R_mult, IH, dotQ_ok, Nat.add_0_r.
  f_equal. assert (E : forall A y z z', (forall j, y j = z j) -> qbil A y z' = qbil A z z').
  { clear. induction A as [|r A IH]; intros y z z' H; simpl; [reflexivity|]. rewrite H. rewrite (IH (shift y) (shift z)); [reflexivity|].
    intros j. apply H. }
  apply E. intros j. unfold shift. f_equal. f_equal. lia.
Qed.
Lemma left_ok P X i : (forall j, (j < n)%nat -> X j = Q2R (start_at F j)) -> (forall v, In v (still P) -> (fst v < n)%nat) -> (i < n)%nat ->
  Q2R (left_at F P i) = xi P X i.
Proof.
  intros H HB Hi. unfold left_at, xi. rewrite Qred_R, Q2R_minus, <- (H i Hi). f_equal.
  induction (still P) as [|v l IH]; simpl; [apply Q2R_0|]. rewrite Q2R_plus, Q2R_mult, <- H by (apply HB; left; reflexivity).
  rewrite IH by (intros; apply HB; right; assumption). reflexivity.
Qed.
Lemma qbil_ext A : forall x x' y y', List.Forall (fun r : list Q => (length r <= n)%nat) A -> (forall i, (i < length A)%nat -> x i = x' i) ->
  (forall i, (i < n)%nat -> y i = y' i) -> qbil A x y = qbil A x' y'.
Proof.
  induction A as [|r A IH]; intros x x' y y' HA Hx Hy; simpl; [reflexivity|]. inversion HA; subst.
  rewrite (Hx 0%nat) by (simpl; lia). rewrite (qdot_ext r y y') by (intros; apply Hy; lia).
  rewrite (IH (shift x) (shift x') y y'); auto. intros i Hi. apply (Hx (S i)). simpl. lia.
Qed.
Lemma value_ok b h v X : check_bound F b h = true -> value_at F b = Some v -> (forall j, (j < n)%nat -> X j = Q2R (start_at F j)) ->
  0 <= Q2R v /\ below b (Q2R v) X.
Proof.
  intros Hb Hv HX. destruct (bound_parts b h Hb) as [HA [HB [_ [_ _]]]]. pose proof Hb as Hb0. unfold check_bound in Hb0.
  assert (HL : forall i, In i (its_agents (about b)) -> Q2R (left_at F (about b) i) = xi (about b) X i).
  { intros i Hi. apply left_ok; [exact HX|intros v' Hv'; apply HA, HB, Hv'|apply HA; exact Hi]. }
  clear Hb. apply andb_prop in Hb0 as [_ Hb]. unfold value_at in Hv. cbv zeta in Hv. destruct (by_ b) as [A|d|p] eqn:Ep; try discriminate; injection Hv as <-.
  2:{ set (P := about b) in *. set (M := fold_right _ _ _). assert (G : 0 <= Q2R M /\ forall i, In i (its_agents P) -> Q2R (share F P d i) <= Q2R M).
      { unfold M. generalize (its_agents P). clear. intros l. assert (L : forall q a, Q2R q <= Q2R (larger q a) /\ Q2R a <= Q2R (larger q a)).
        { intros q a. unfold larger. destruct (Qle_bool a q) eqn:E; [apply Qle_R in E; lra|].
          assert (Q2R q < Q2R a); [|lra]. apply Rnot_le_lt. intros N. apply Rle_Qle in N. apply Qle_bool_iff in N. congruence. }
        induction l as [|j l [I1 I2]]; [split; [rewrite <- Q2R_0; apply Rle_refl|intros i []]|]. cbn [fold_right].
        destruct (L (share F P d j) (fold_right (fun i a => larger (share F P d i) a) 0%Q l)) as [L1 L2]. split; [lra|].
        intros i [<-|Hi]; [exact L1|]. specialize (I2 i Hi). lra. }
      destruct G as [G0 G1]. split; [exact G0|]. unfold below. rewrite Ep. fold P. intros i Hi. specialize (G1 i Hi). unfold share in G1. fold (entry d i).
      destruct (rows_parts F Hmodes b d Hb) as [_ [R2 _]]. fold P in R2. destruct (R2 i Hi) as [[_ [_ [Z0 Z1]]]|[_ [Dp _]]].
      - rewrite Z0, Z1. unfold sq. lra.
      - destruct (pos (entry d i)) eqn:Ed.
        2:{ exfalso. unfold pos in Ed. apply Z.ltb_ge, IZR_le in Ed. unfold Q2R in Dp.
            assert (0 < / IZR (Zpos (Qden (entry d i)))) by (apply Rinv_0_lt_compat, IZR_lt; reflexivity). nra. }
        cbv zeta in G1. assert (N : ~ (entry d i == 0)%Q) by (intros E; apply Qeq_eqR in E; rewrite Q2R_0 in E; lra).
        rewrite Qred_R, Q2R_mult, Q2R_div, (HL i Hi) in G1 by exact N. set (di := Q2R (entry d i)) in *. set (y := xi P X i) in *.
        replace y with (y / di * di) by (field; lra). unfold sq. set (w := y / di) in *. assert (0 <= di * di) by nra. nra. }
  unfold below. rewrite Ep. fold c n.
  set (P := about b) in *. set (x0 := fun i => nth i (map (left_at F P) (seq 0 n)) 0%Q).
  assert (E : Q2R (bilQ A x0 0) = qbil A (xi P X) (xi P X)).
  { rewrite bilQ_ok. unfold check_family_form in Hb. cbv zeta in Hb. do 4 apply andb_prop in Hb as [Hb _]. fold c n P in Hb.
    unfold check_quotient in Hb. cbv zeta in Hb. apply andb_prop in Hb as [Hb _]. apply andb_prop in Hb as [_ Hf]. cbn [qn quotient_of] in Hf.
    destruct (fits_ok _ _ Hf) as [F1 F2]. rewrite map_length in F1.
    assert (E0 : forall i, (i < n)%nat -> Q2R (x0 i) = xi P X i).
    { intros i Hi. unfold x0. rewrite (nth_map_seq _ n i) by exact Hi. apply left_ok; [exact HX| |exact Hi].
      intros v Hv. apply HA. apply HB. exact Hv. }
    apply qbil_ext; [|intros i Hi; apply E0; lia|intros i Hi; apply E0; exact Hi].
    unfold rows_le in F2. rewrite List.Forall_forall in F2 |- *. intros r Hr. specialize (F2 (map (scaled (common (concat A))) r) ltac:(apply in_map; exact Hr)).
    rewrite map_length in F2. exact F2. }
  rewrite E. split; [|lra].
  unfold check_family_form in Hb. cbv zeta in Hb. apply andb_prop in Hb as [Hb H5]. do 3 apply andb_prop in Hb as [Hb _].
  destruct (factor_mod _ _ _ _) as [r|] eqn:Er in H5; [|discriminate]. apply (value_pos n P A Hb r Er).
Qed.
Theorem peaks_ok : check_peaks F = true -> forall X S t i m w, starts F X S -> 0 <= t < T -> (i < length (peaks F))%nat ->
  In m (modes F) -> admits (ties m) w -> Rabs (gain T rho (k c) t * member (ties m) w (X t) i) + added c S t i <= Q2R (nth i (peaks F) 0%Q).
Proof.
  intros H X Sl t i m w HS Ht Hi Hm Hw.
  assert (HP : at_first F && forallb (fun p => check_peak F (fst p) (nominal_peak F (snd p))) (combine (seq 0 (length (peaks F))) (peaks F)) = true)
    by (unfold check_peaks in H; destruct (peaks F); [simpl in Hi; lia|exact H]).
  clear H. apply andb_prop in HP as [HA H]. pose proof (starts_quiet F Hframe X Sl HA HS) as HM. rewrite forallb_forall in H.
  assert (H0 : forall j, (j < n)%nat -> X 0 j = Q2R (start_at F j)) by (intros j Hj; apply HS; exact Hj).
  assert (K : In (i, nth i (peaks F) 0%Q) (combine (seq 0 (length (peaks F))) (peaks F))).
  { apply (in_numbered _ (peaks F) 0%nat); [apply nth_error_nth'|]; exact Hi. }
  specialize (H _ K). cbn [fst snd] in H. clear K. set (q := nominal_peak F (nth i (peaks F) 0%Q)) in *.
  assert (EA : (i < n)%nat -> Q2R (nth i (peaks F) 0%Q) = Q2R q + added c Sl t i).
  { intros Hn. unfold q, nominal_peak, added. fold c. destruct (kind c); [ring|]. destruct HM as [_ [_ Z]]. rewrite (Z t i Ht Hn), Rabs_R0, Q2R_minus. ring. }
  unfold check_peak in H. cbv zeta in H. fold c in H. apply andb_prop in H as [Hn H]. apply andb_prop in H as [N H].
  apply Nat.ltb_lt in Hn. rewrite (EA Hn). apply Rplus_le_compat_r. apply notneg_R in N. apply orb_prop in H as [H|H].
  - rewrite (unmoved_ok F i m w (X t) H Hm), Rmult_0_r, Rabs_R0. exact N.
  - apply existsb_exists in H as [b [Hb H]]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2]. apply mem_In in H2.
    destruct (bound_of b Hb) as [h Hh]. destruct (value_at F b) as [v|] eqn:Ev; [|discriminate].
    destruct (value_ok b h v (X 0) Hh Ev H0) as [V0 V1].
    pose proof (inputs_fall b h i X Sl 0 (Q2R v) t m w Hh H1 H2 HM V0 V1 Ht Hm Hw) as B.
    destruct (positive_ F Hframe) as [P1 [P2 P3]]. assert (S0 : s c 0 = 0) by (apply (clock_0 T rho (k c) P1)). rewrite S0, Rmult_0_r, exp_0, Rmult_1_r in B.
    apply Qle_R in H3. rewrite !Q2R_mult, Q2R_plus, !Q2R_mult in H3.
    assert (ES : Q2R (/ span c) = / T).
    { rewrite Q2R_inv; [unfold T; rewrite span_ok; reflexivity|]. intros E. apply Qeq_eqR in E. rewrite span_ok, Q2R_0 in E. fold T in E. lra. }
    rewrite ES in H3. change (Q2R (rho2 c) * Q2R (kappa c)) with (k c) in H3. change (k c * / T) with (k c / T) in H3. change (Q2R (rho1 c)) with rho in H3.
    set (u := _ * member _ _ _ _) in *. unfold sq in B. apply Rabs_le. split; nra.
Qed.
Theorem ends_hold hull es : forallb (check_pivots F) (parts F) = true -> (forall P, In P (parts F) -> kernel_claim F P) ->
  check_family_ends F hull es = true -> ends_claim F.
Proof.
  intros HV HK. apply (ends_ok F hull es Hframe Hmodes); intros b.
  - intros Hb. destruct (bound_of b Hb) as [h Hh]. destruct (bound_parts b h Hh) as [B1 [_ [B2 [B3 [B4 _]]]]]. auto.
  - intros HP. split.
    + rewrite forallb_forall in HV. specialize (HV b HP). unfold check_pivots in HV. cbv zeta in HV. apply andb_prop in HV as [HV _].
      rewrite forallb_forall in HV. intros i Hi. apply Nat.ltb_lt, HV, Hi.
    + intros ND X Sl HM. destruct (HK b HP ND) as [q1 [q2 [_ G]]]. destruct (G X Sl HM) as [y [Hy _]]. exists y.
      intros i Hi. destruct (Hy i Hi). auto.
  - intros v X Hb. destruct (bound_of b Hb) as [h Hh]. apply (value_ok b h v X Hh).
Qed.
End Main.

(** what is known of limits, and a box that holds all agents *)
Record limits := Limits { hull : list Q * list Q; told : list (nat * list fact) }.
Definition accepts_family (F : family) (hs : list hint) (ws : list (option why)) (l : limits) : bool :=
  check_family F hs ws && check_family_ends F (hull l) (told l) && check_boxes F (hull l).
Theorem accepts_family_sound F hs ws l : accepts_family F hs ws l = true -> true_family F.
Proof.
  intros H. unfold accepts_family in H. apply andb_prop in H as [H H11]. apply andb_prop in H as [H H5]. unfold check_family in H.
  apply andb_prop in H as [H H7]. apply andb_prop in H as [H H6].
  apply andb_prop in H as [H H4]. apply andb_prop in H as [H H10]. apply andb_prop in H as [H H9].
  apply andb_prop in H as [H H8]. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  destruct (frame_parts F H1) as [A1 [A2 [A3 A4]]].
  assert (A0 : modes F <> []) by (intros E; unfold check_frame in H1; rewrite E in H1; discriminate H1).
  split; [intros m Hm; apply (modes_claim F H2 m Hm)|].
  assert (AP : forall P, In P (parts F) -> part_claim F P /\ kernel_claim F P).
  { intros P HP. rewrite forallb_forall in H3, H8, H10. apply Nat.eqb_eq in H9. destruct (in_combine _ ws P H9 HP) as [w Hw].
    split; [apply (parts_claim F H2 P w (H8 P HP) (H10 _ Hw) (H3 P HP))|].
    intros ND. apply (common_kernel F P H1 H2 (H3 P HP) (H8 P HP) ND ND). }
  split; [exact AP|].
  split; [exact A4|]. split; [split; [exact A3|apply (sliding_ok _ A1 A2)]|].
  split; [intros b Hb; destruct (bound_of F hs H4 b Hb) as [h Hh]; apply (bounds_claim F H1 H2 b h Hh)|].
  split; [apply (ends_hold F H1 H2 hs H4 _ _ H8 (fun P HP => proj2 (AP P HP)) H5)|].
  split; [split; [apply (stays_ok F H1 H2 hs H4 H6)|apply (peaks_ok F H1 H2 hs H4 H7)]|].
  split; [apply (boxes_ok F H1 H2 (hull l) H11)|]. apply (family_motions_exist F A1 A0 H2).
Qed.
