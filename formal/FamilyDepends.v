(** Why what becomes of a component depends on the signal: a state that is at rest in one member moves in another. Either one
    mandatory graph has more balanced closed components than another one, and so more states at rest; or a state at rest is
    near a stated one, near enough to tell that it moves. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Claims Mean Table Dominance Rest Wide FamilyCertificate FamilyChecker
  FamilySound FamilyMotion FamilyRows FamilyRest FamilyNear.
Open Scope R_scope.

Lemma lap_same es x y j : (forall e, In e es -> tgt e = j -> x j = y j /\ x (src e) = y (src e)) -> lap es x j = lap es y j.
Proof.
  intros H. rewrite !lap_esum. apply esum_ext. intros e He. unfold lap_edge. destruct (Nat.eqb_spec (tgt e) j) as [E|_]; [|reflexivity].
  destruct (H e He E) as [-> ->]. reflexivity.
Qed.
Lemma lap_null es j : lap es (fun _ => 0) j = 0.
Proof. unfold lap. induction es as [|e es IH]; simpl; [reflexivity|]. rewrite IH. unfold lap_edge. destruct (tgt e =? j)%nat; ring. Qed.
Lemma lap_zero es x j : (forall e, In e es -> tgt e = j -> x j = 0 /\ x (src e) = 0) -> lap es x j = 0.
Proof. intros H. rewrite <- (lap_null es j). apply lap_same. exact H. Qed.
Lemma lap_tot es bs (f : nat * list Q -> nat -> R) c j : lap es (fun i => tot bs (fun b => f b i) c) j = tot bs (fun b => lap es (f b) j) c.
Proof.
  induction bs as [|b bs IH]; simpl; [apply lap_null|]. rewrite (lap_plus es (fun i => f b i * c (fst b))), IH.
  enough (E : lap es (fun i => f b i * c (fst b)) j = lap es (f b) j * c (fst b)) by (rewrite E; reflexivity). clear.
  unfold lap. induction es as [|e es IHe]; simpl; [ring|]. rewrite IHe. unfold lap_edge. destruct (tgt e =? j)%nat; ring.
Qed.
Lemma NoDup_both (l l' : list nat) : NoDup l -> NoDup l' -> (forall i, In i l -> ~ In i l') -> NoDup (l ++ l').
Proof.
  induction l as [|i l IH]; intros N N' H; simpl; [exact N'|]. apply NoDup_cons_iff in N as [N1 N2]. constructor.
  - intros I. apply in_app_iff in I as [I|I]; [exact (N1 I)|]. exact (H i ltac:(left; reflexivity) I).
  - apply IH; [exact N2|exact N'|intros; apply H; right; assumption].
Qed.
Definition keyed (l : list nat) : list (nat * list Q) := map (fun i => (i, [])) l.
Lemma keyed_fst l : map fst (keyed l) = l.
Proof. unfold keyed. rewrite map_map. apply map_id. Qed.
Lemma in_keyed l b : In b (keyed l) -> In (fst b) l.
Proof. intros H. apply (in_map fst) in H. rewrite keyed_fst in H. exact H. Qed.
Lemma keyed_in l i : In i l -> In (i, []) (keyed l).
Proof. intros H. apply in_map_iff. exists i. auto. Qed.

Section Counter.
Variables (F : family) (P : part).
Let n := order (frame F).
Let C := its_agents P.
Hypothesis Hmodes : forallb (check_mode F) (modes F) = true.
Hypothesis Hpart : check_part F P = true.
Hypothesis Hbasis : check_pivots F P = true.
Local Notation top := (fun D : comp => hd O (nodes D)).

(** a state at rest in a member is a motion *)
Lemma rests m q : In m (modes F) -> (forall i, (i < n)%nat -> lap (edges (mandatory m)) q i = 0) -> switches F (fun _ => q) (fun _ _ => 0).
Proof.
  intros Hm Hq. split; [|split].
  - unfold slides. destruct (kind (frame F)); [reflexivity|]. intros t i e _ _ Z. contradiction Z. reflexivity.
  - intros t i _ _. split; apply continuous_const.
  - exists (fun _ => 0). intros t _ _. destruct (smallest_ok n (ties m) (ties_ok F Hmodes m Hm)) as [w [W1 W2]].
    destruct (modes_claim F Hmodes m Hm) as [Ee _]. exists m, w. split; [exact Hm|]. split; [exact W1|]. intros i Hi.
    rewrite W2, <- Ee, (Hq i Hi), Rmult_0_r, Ropp_0. apply (is_derive_const (q i - 0)).
Qed.

Section One.
Variable m : mode.
Hypothesis Hm : In m (modes F).
Let es := edges (mandatory m).
Definition followers : list nat := filter (fun i => mem i C && negb (leads m i)) (seq 0 n).
Lemma leads_ok i : leads m i = true <-> exists D, In D (comps (mandatory m)) /\ In i (nodes D).
Proof. unfold leads. rewrite existsb_exists. split; intros [D [A B]]; exists D; (split; [exact A|]); apply mem_In; exact B. Qed.
Lemma followers_ok i : In i followers <-> In i C /\ leads m i = false.
Proof.
  unfold followers. rewrite filter_In, andb_true_iff, negb_true_iff, mem_In. split; [tauto|]. intros [A B].
  split; [apply in_seq; pose proof (agents_in F P Hbasis i A); unfold n; lia|auto].
Qed.
Lemma closed_comp D : In D (comps (mandatory m)) -> closed_component es (fun i => In i (nodes D)).
Proof. intros HD. destruct (mode_parts F Hmodes m Hm) as [_ W]. destruct (wide_parts _ W) as [_ [_ [W2 _]]]. apply (W2 D HD). Qed.
(** agents that do not follow hear no followers *)
Lemma outside e : In e es -> ~ In (tgt e) followers -> ~ In (src e) followers.
Proof.
  intros He Ht Hs. apply Ht. apply followers_ok in Hs as [S1 S2]. apply followers_ok. split; [apply (part_inside F P Hmodes Hpart m e Hm He); exact S1|].
  destruct (leads m (tgt e)) eqn:L; [|reflexivity]. apply leads_ok in L as [D [HD HT]]. destruct (closed_comp D HD) as [_ [Cl _]].
  assert (L : leads m (src e) = true) by (apply leads_ok; exists D; split; [exact HD|apply Cl; assumption]). congruence.
Qed.
Lemma zero_ok x : (forall i, ~ In i followers -> x i = 0) -> (forall j, In j followers -> lap es x j = 0) -> forall i, In i C -> x i = 0.
Proof.
  intros Hx HL i Hi. assert (K : Rabs (x i) <= 0).
  { apply (kernel_bound F P Hmodes Hpart Hbasis m Hm x 0 (Rle_refl 0)); [| |exact Hi].
    - intros j _. destruct (in_dec Nat.eq_dec j followers) as [I|N]; [apply HL; exact I|]. apply lap_zero. intros e He Et.
      split; apply Hx; [exact N|]. apply (outside e He). rewrite Et. exact N.
    - intros D HD _. rewrite Hx; [rewrite Rabs_R0; apply Rle_refl|]. intros I. apply followers_ok in I as [_ L].
      unfold owned in HD. apply filter_In in HD as [HD _]. destruct (hd_in F Hmodes m Hm D HD) as [Hh _].
      assert (Y : leads m (hd O (nodes D)) = true) by (apply leads_ok; exists D; auto). congruence. }
  apply no_size. exact K.
Qed.
(** leaders at rest determine followers *)
Lemma dirichlet tau : (forall i, ~ In i C -> tau i = 0) -> (forall i, In i C -> leads m i = true -> lap es tau i = 0) ->
  exists q, (forall i, ~ In i followers -> q i = tau i) /\ forall i, lap es q i = 0.
Proof.
  intros T0 T1. set (one := fun (b : nat * list Q) i => if (i =? fst b)%nat then 1 else 0).
  set (X := fun c i => tot (keyed followers) (fun b => one b i) c).
  assert (N : NoDup (map fst (keyed followers))) by (rewrite keyed_fst; apply NoDup_filter, seq_NoDup).
  assert (X0 : forall c i, ~ In i followers -> X c i = 0).
  { intros c i Hi. apply tot_null. intros b Hb. apply in_keyed in Hb. unfold one. destruct (Nat.eqb_spec i (fst b)) as [->|_]; [contradiction|reflexivity]. }
  destruct (solvable (keyed followers) (fun j b => lap es (one b) j) followers N) with (tau := fun j => - lap es tau j) as [c Hc].
  - unfold keyed. rewrite map_length. lia.
  - intros c Hc b Hb. rewrite <- (Rmult_1_l (c (fst b))). replace 1 with (one b (fst b)) by (unfold one; rewrite Nat.eqb_refl; reflexivity).
    assert (E : X c (fst b) = one b (fst b) * c (fst b)).
    { apply (tot_single (keyed followers) (fun b' => one b' (fst b)) c b N Hb). intros b' _ Ne. unfold one.
      destruct (Nat.eqb_spec (fst b) (fst b')) as [E|_]; [contradiction Ne; symmetry; exact E|reflexivity]. }
    rewrite <- E. apply (zero_ok (X c) (X0 c)); [|apply in_keyed in Hb; apply followers_ok in Hb; apply Hb].
    intros j Hj. unfold X. rewrite lap_tot. apply Hc. exact Hj.
  - exists (fun i => tau i + X c i). split; [intros i Hi; rewrite (X0 c i Hi); ring|]. intros j. rewrite lap_plus.
    destruct (in_dec Nat.eq_dec j followers) as [I|I].
    + unfold X. rewrite lap_tot, (Hc j I). ring.
    + assert (Z : lap es (X c) j = 0).
      { apply lap_zero. intros e He Et. split; apply X0; [exact I|]. apply (outside e He). rewrite Et. exact I. }
      rewrite Z, Rplus_0_r. destruct (in_dec Nat.eq_dec j C) as [J|J].
      * apply (T1 j J). destruct (leads m j) eqn:L; [reflexivity|]. contradiction I. apply followers_ok. auto.
      * apply lap_zero. intros e He Et. destruct (part_inside F P Hmodes Hpart m e Hm He) as [_ [_ [_ K]]]. split; apply T0; [exact J|].
        intros S. apply K in S. rewrite Et in S. exact (J S).
Qed.

(** * More balanced closed components *)
Definition gauge_of (D : comp) (i : nat) : R := match camps D with Gauge g => sgn g i | Cycle _ => 0 end.
Definition phi (k i : nat) : R := match find (fun D => (hd O (nodes D) =? k)%nat) (heads m P) with
  | Some D => if mem i (nodes D) then gauge_of D i else 0 | None => if (i =? k)%nat then 1 else 0 end.
Definition keys : list nat := map top (heads m P) ++ followers.
Lemma head_ok D : In D (heads m P) -> In D (comps (mandatory m)) /\ In (hd O (nodes D)) (nodes D) /\ (forall i, In i (nodes D) -> In i C) /\
  balanced es (nodes D) (fun i => match camps D with Gauge g => nth i g 0%Z | Cycle _ => 0%Z end).
Proof.
  intros H. unfold heads, owned in H. apply filter_In in H as [H B]. apply filter_In in H as [HD H]. apply mem_In in H. fold C in H.
  destruct (hd_in F Hmodes m Hm D HD) as [Hh _]. destruct (mode_parts F Hmodes m Hm) as [_ W]. destruct (wide_parts _ W) as [_ [_ [W2 _]]].
  destruct (W2 D HD) as [[_ [_ St]] Ba]. split; [exact HD|]. split; [exact Hh|]. split.
  - intros i Hi. apply (closed_path es (fun j => In j C) i (hd O (nodes D))); [|apply St; assumption|exact H].
    intros e He Ht. apply (part_inside F P Hmodes Hpart m e Hm He). exact Ht.
  - unfold is_balanced in B. destruct (camps D) as [g|]; [exact Ba|discriminate].
Qed.
Lemma phi_cases k : (exists D, In D (heads m P) /\ hd O (nodes D) = k /\ forall i, phi k i = if mem i (nodes D) then gauge_of D i else 0) \/
  ((forall D, In D (heads m P) -> hd O (nodes D) <> k) /\ forall i, phi k i = if (i =? k)%nat then 1 else 0).
Proof.
  unfold phi. destruct (find _ (heads m P)) as [D|] eqn:E.
  - left. apply find_some in E as [A B]. apply Nat.eqb_eq in B. exists D. auto.
  - right. split; [|reflexivity]. intros D HD Ek. pose proof (find_none _ _ E D HD) as K. simpl in K. rewrite Ek, Nat.eqb_refl in K. discriminate.
Qed.
Lemma phi_still k j : In k keys -> ~ In j followers -> lap es (phi k) j = 0.
Proof.
  intros Hk Hj. destruct (phi_cases k) as [[D [HD [Ek Ephi]]]|[No Ephi]].
  - destruct (head_ok D HD) as [HD' [Hh [Sub [G1 G2]]]]. destruct (closed_comp D HD') as [_ [Cl _]].
    destruct (in_dec Nat.eq_dec j (nodes D)) as [I|I].
    + rewrite lap_esum. rewrite (esum_ext _ _ (fun e => 0 * lap_edge j (phi k) e)); [rewrite esum_scal; ring|]. intros e He. rewrite Rmult_0_l.
      unfold lap_edge. destruct (Nat.eqb_spec (tgt e) j) as [Et|_]; [|reflexivity]. subst j. pose proof (Cl e He I) as Is. specialize (G2 e He Is I).
      rewrite !Ephi, (proj2 (mem_In _ _) I), (proj2 (mem_In _ _) Is). unfold gauge_of. specialize (G1 _ I) as Ga. specialize (G1 _ Is) as Gb.
      destruct (camps D) as [g|]; [|lra]. unfold sgn. apply Qlt_Rlt in G2. rewrite Q2R_mult, Q2R_0 in G2.
      destruct Ga as [Ga|Ga], Gb as [Gb|Gb]; rewrite Ga, Gb in *; set (w := Q2R (wt e)) in *; unfold Q2R, inject_Z in G2; simpl in G2;
        ((rewrite (Rabs_right w) by lra) || (rewrite (Rabs_left w) by lra)); lra.
    + apply lap_zero. intros e He Et. subst j. rewrite !Ephi. destruct (mem (tgt e) (nodes D)) eqn:Mt; [apply mem_In in Mt; contradiction|].
      split; [reflexivity|]. destruct (mem (src e) (nodes D)) eqn:Ms; [|reflexivity]. exfalso. apply mem_In in Ms.
      assert (Ct : In (tgt e) C) by (apply (part_inside F P Hmodes Hpart m e Hm He); apply Sub; exact Ms).
      destruct (leads m (tgt e)) eqn:L; [|apply Hj; apply followers_ok; auto]. apply leads_ok in L as [D' [HD2 Ht]].
      destruct (closed_comp D' HD2) as [_ [Cl' St']]. apply I. apply (closed_path es (fun i => In i (nodes D)) (tgt e) (src e) Cl); [|exact Ms].
      apply St'; [exact Ht|apply Cl'; assumption].
  - apply lap_zero. assert (Fk : In k followers).
    { unfold keys in Hk. apply in_app_iff in Hk as [Hk|Hk]; [|exact Hk]. apply in_map_iff in Hk as [D [Ek HD]]. destruct (No D HD Ek). }
    intros e He Et. rewrite !Ephi. pose proof (outside e He ltac:(rewrite Et; exact Hj)) as Hs.
    split; [destruct (Nat.eqb_spec j k) as [->|_]|destruct (Nat.eqb_spec (src e) k) as [E|_]]; try reflexivity; try contradiction.
    rewrite E in Hs. contradiction.
Qed.
End One.

Theorem counts_ok m m' : In m (modes F) -> In m' (modes F) -> check_counts P m m' = true -> exists q, switches F (fun _ => q) (fun _ _ => 0) /\
  exists i, In i C /\ lap (edges (mandatory m')) q i <> 0.
Proof.
  intros Hm Hm' H. unfold check_counts in H. cbv zeta in H. apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2].
  apply Nat.ltb_lt in H1. apply distinct_ok in H2. rewrite forallb_forall in H3. set (es := edges (mandatory m)). set (fs := followers m).
  assert (Apart : forall D, In D (heads m P) -> forall j, In j fs -> ~ In j (nodes D)).
  { intros D HD j Hj I. apply (followers_ok m) in Hj as [_ L]. destruct (head_ok m Hm D HD) as [HD' _].
    assert (Y : leads m j = true) by (apply leads_ok; exists D; auto). congruence. }
  assert (N : NoDup (map fst (keyed (keys m)))).
  { rewrite keyed_fst. apply NoDup_both; [exact H2|apply NoDup_filter, seq_NoDup|]. intros i Hi Hf. apply in_map_iff in Hi as [D [<- HD]].
    apply (Apart D HD _ Hf). apply (head_ok m Hm D HD). }
  destruct (fewer (keyed (keys m)) N (map (fun j b => lap es (phi m (fst b)) j) fs ++ map (fun D b => phi m (fst b) (hd O (nodes D))) (heads m' P)))
    as [c [[b [B1 B2]] Hc]].
  { unfold keyed, keys. rewrite app_length, !map_length, app_length, map_length. fold fs. lia. }
  set (q := fun i => tot (keyed (keys m)) (fun b => phi m (fst b) i) c).
  assert (Out : forall i, ~ In i C -> q i = 0).
  { intros i Hi. apply tot_null. intros b' Hb'. apply in_keyed in Hb'. destruct (phi_cases m (fst b')) as [[D [HD [_ ->]]]|[No ->]].
    - destruct (mem i (nodes D)) eqn:Mi; [|reflexivity]. apply mem_In in Mi. destruct (head_ok m Hm D HD) as [_ [_ [Sub _]]]. destruct (Hi (Sub i Mi)).
    - destruct (Nat.eqb_spec i (fst b')) as [->|_]; [|reflexivity]. unfold keys in Hb'. apply in_app_iff in Hb' as [K|K].
      + apply in_map_iff in K as [D [Ek HD]]. destruct (No D HD Ek).
      + apply (followers_ok m) in K as [K _]. contradiction. }
  assert (Q1 : forall j, lap es q j = 0).
  { intros j. unfold q. rewrite lap_tot. destruct (in_dec Nat.eq_dec j fs) as [I|I].
    - apply (Hc (fun b => lap es (phi m (fst b)) j)). apply in_app_iff. left. apply in_map_iff. exists j. auto.
    - apply tot_null. intros b' Hb'. apply in_keyed in Hb'. apply (phi_still m Hm (fst b') j Hb' I). }
  assert (Qb : q (fst b) = phi m (fst b) (fst b) * c (fst b) /\ phi m (fst b) (fst b) <> 0 /\ In (fst b) C).
  { pose proof (in_keyed _ _ B1) as K. split; [|split].
    - apply (tot_single (keyed (keys m)) (fun b' => phi m (fst b') (fst b)) c b N B1). intros b' Hb' Ne. apply in_keyed in Hb'.
      destruct (phi_cases m (fst b')) as [[D [HD [Ek ->]]]|[No ->]].
      + destruct (mem (fst b) (nodes D)) eqn:Mb; [|reflexivity]. exfalso. pose proof Mb as Mb'. apply mem_In in Mb. unfold keys in K. apply in_app_iff in K as [K|K].
        * apply in_map_iff in K as [D' [Ek' HD']]. specialize (H3 D HD). rewrite forallb_forall in H3. specialize (H3 D' HD').
          rewrite Ek' in H3. rewrite Mb', orb_false_r in H3. apply Nat.eqb_eq in H3. apply Ne. rewrite <- Ek. exact H3.
        * exact (Apart D HD _ K Mb).
      + destruct (Nat.eqb_spec (fst b) (fst b')) as [E|_]; [contradiction Ne; symmetry; exact E|reflexivity].
    - destruct (phi_cases m (fst b)) as [[D [HD [Ek ->]]]|[No ->]]; [|rewrite Nat.eqb_refl; lra].
      destruct (head_ok m Hm D HD) as [_ [Hh [_ [G _]]]]. rewrite Ek in Hh. rewrite (proj2 (mem_In _ _) Hh). specialize (G _ Hh). unfold gauge_of, sgn.
      destruct (camps D); destruct G as [G|G]; try discriminate; rewrite G; lra.
    - unfold keys in K. apply in_app_iff in K as [K|K]; [|apply (followers_ok m) in K; apply K].
      apply in_map_iff in K as [D [<- HD]]. destruct (head_ok m Hm D HD) as [_ [Hh [Sub _]]]. apply Sub. exact Hh. }
  exists q. split; [apply (rests m q Hm); intros; apply Q1|].
  apply Classical_Prop.NNPP. intros No. destruct Qb as [Q2 [Q3 Q4]].
  assert (Z : Rabs (q (fst b)) <= 0).
  { apply (kernel_bound F P Hmodes Hpart Hbasis m' Hm' q 0 (Rle_refl 0)); [| |exact Q4].
    - intros i _. destruct (in_dec Nat.eq_dec i C) as [I|I].
      + destruct (Req_dec (lap (edges (mandatory m')) q i) 0) as [E|E]; [exact E|]. contradiction No. exists i. auto.
      + apply lap_zero. intros e He Et. destruct (part_inside F P Hmodes Hpart m' e Hm' He) as [_ [_ [_ K]]]. split; apply Out; [exact I|].
        intros S. apply K in S. rewrite Et in S. exact (I S).
    - intros D HD HB. assert (E : q (hd O (nodes D)) = 0).
      { apply (Hc (fun b => phi m (fst b) (hd O (nodes D)))). apply in_app_iff. right. apply in_map_iff. exists D. split; [reflexivity|].
        unfold heads. apply filter_In. auto. }
      rewrite E, Rabs_R0. apply Rle_refl. }
  apply no_size in Z. rename Z into E. rewrite Q2 in E. apply Rmult_integral in E as [E|E]; contradiction.
Qed.
End Counter.
