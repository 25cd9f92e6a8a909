(** What a balanced leader group of many nodes keeps: its left null vector, which exists, is near the one that the document
    states, and tells where the group ends. With [lam'L = 0], [v] stated, [delta = w - v], [w] the multiple of [lam] that is
    [v] at one node: [|delta_i| <= m u_i] for the largest [m] of [|(v'L)_j| / (u'M)_j], [j] the other nodes. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Flow Certificate Checker Sound Input Mean Table Dominance Weighted Rest Enclose Group Sparse Factor.
Open Scope R_scope.

(** * The check *)
(** of a group: the left null vector as integers on its nodes, and the node where it is taken as it is stated *)
Record stated := Stated { which : nat; vector_of : list (nat * Z); fixed : nat }.
(** [u'M] by node *)
Definition pushes (ls : Z) (own : list edge) (U : M.t Z) : M.t Z :=
  fold_right (fun e m => let a := (get U (tgt e) * Z.abs (scaled ls (wt e)))%Z in bump (tgt e) a (bump (src e) (- a)%Z m)) (M.empty Z) own.
(** [g]: camps, [U]: the vector [u], [X], [S]: middles and radii, [B]: initial states *)
Definition check_kept (own : list edge) (C : list nat) (g U X S : M.t Z) (B : nat -> Z) (v : stated) : bool :=
  let ls := common (map wt own) in let V := by_node (vector_of v) in let rho := left_product ls own V in
  let top := fixed v in let U0 := M.add top 0%Z U in let push := pushes ls own U0 in let inside := marked C in
  let rest := filter (other top) C in
  let exact := forallb (fun i => get rho i =? 0)%Z C in
  let m := if exact then (0, 1)%Z else fold_right (fun i a => larger a (Z.abs (get rho i), get push i)) (0, 1)%Z rest in
  let h := hd O C in let x := (get g h * get X h)%Z in
  let d i := (B i - x * get g i)%Z in
  let D := (snd m * zsum (map (fun i => get V i * get g i) C) - fst m * zsum (map (fun i => get U0 i) C))%Z in
  let A := (snd m * Z.abs (zsum (map (fun i => get V i * d i) C)) + fst m * zsum (map (fun i => get U0 i * Z.abs (d i)) C))%Z in
  good ls (map wt own) && forallb (fun e => seen (tgt e) inside && seen (src e) inside) own && seen top inside &&
  forallb (fun e => let w := scaled ls (wt e) in Z.abs w * get g (tgt e) =? w * get g (src e))%Z own &&
  forallb (fun i => get g i * get g i =? 1)%Z C && (0 <? snd m)%Z && (0 <=? fst m)%Z && (0 <? D)%Z &&
  (exact || forallb (fun i => (0 <? get U i) && (0 <? get push i) && (Z.abs (get rho i) * snd m <=? fst m * get push i))%Z rest) &&
  forallb (fun i => Z.abs (get g i * get X i - x) * D + A <=? get S i * D)%Z C.

(** * More vectors than places are dependent *)
Lemma find_nonzero (C : list nat) (f : nat -> R) : (exists i, In i C /\ f i <> 0) \/ forall i, In i C -> f i = 0.
Proof.
  induction C as [|a C IH]; [right; intros i []|]. destruct (Req_dec (f a) 0) as [E|N].
  - destruct IH as [[i [Hi H]]|H]; [left; exists i; split; [right; exact Hi|exact H]|]. right. intros i [<-|Hi]; [exact E|apply H; exact Hi].
  - left. exists a. split; [left; reflexivity|exact N].
Qed.
Lemma length_other C a : NoDup C -> In a C -> length C = S (length (filter (other a) C)).
Proof.
  intros N H. apply INR_eq. rewrite S_INR, !length_fsum, (fsum_split a C _ N H). reflexivity.
Qed.
Lemma dependent D : forall C (a : nat -> nat -> R), NoDup C -> (length D < length C)%nat ->
  exists lam, (exists i, In i C /\ lam i <> 0) /\ forall j, In j D -> fsum C (fun i => lam i * a i j) = 0.
Proof.
  induction D as [|d D IH]; intros C a N L.
  - exists (fun _ => 1). split; [|intros j []]. destruct C as [|i C]; [simpl in L; lia|]. exists i. split; [left; reflexivity|lra].
  - simpl in L. destruct (find_nonzero C (fun i => a i d)) as [[p [Hp Np]]|Z].
    + set (C' := filter (other p) C). pose proof (length_other C p N Hp) as LC. fold C' in LC.
      destruct (IH C' (fun i j => a i j - a i d / a p d * a p j) (NoDup_filter _ N) ltac:(lia)) as [mu [[q [Hq Nq]] Hmu]].
      set (s := fsum C' (fun i => mu i * (a i d / a p d))).
      set (lam := fun i => if (i =? p)%nat then - s else mu i).
      assert (E : forall i, In i C' -> lam i = mu i).
      { intros i Hi. apply filter_In in Hi as [_ Hi]. unfold other in Hi. apply negb_true_iff in Hi. unfold lam. rewrite Hi. reflexivity. }
      assert (Sum : forall j, fsum C (fun i => lam i * a i j) = fsum C' (fun i => mu i * (a i j - a i d / a p d * a p j))).
      { intros j. rewrite (fsum_split p C _ N Hp). fold C'. unfold lam at 2. rewrite Nat.eqb_refl.
        rewrite (fsum_ext C' _ (fun i => mu i * a i j)) by (intros i Hi; rewrite (E i Hi); reflexivity).
        replace (- s * a p j) with ((- a p j) * s) by ring. unfold s. rewrite <- fsum_scal, <- fsum_plus. apply fsum_ext. intros; ring. }
      exists lam. split; [exists q; split; [apply filter_In in Hq; apply Hq|rewrite (E q Hq); exact Nq]|].
      intros j [<-|Hj]; rewrite Sum; [|apply Hmu; exact Hj].
      rewrite (fsum_ext C' _ (fun _ => 0 * 1)); [rewrite fsum_scal; ring|]. intros i _. field. exact Np.
    + destruct (IH C a N ltac:(lia)) as [lam [H1 H2]]. exists lam. split; [exact H1|]. intros j [<-|Hj]; [|apply H2; exact Hj].
      rewrite (fsum_ext C _ (fun _ => 0 * 1)); [rewrite fsum_scal; ring|]. intros i Hi. rewrite (Z i Hi). ring.
Qed.

(** * The left null vector *)
Section Null.
Variables (own : list edge) (C : list nat) (g : nat -> R) (top : nat).
Hypothesis Hin : forall e, In e own -> In (tgt e) C /\ In (src e) C.
Hypothesis HN : NoDup C.
Hypothesis Htop : In top C.
Hypothesis Hg : forall i, In i C -> g i * g i = 1.
Hypothesis Hedge : forall e, In e own -> Rabs (Q2R (wt e)) * g (tgt e) = Q2R (wt e) * g (src e).
Lemma lap_gauge i : lap own g i = 0.
Proof.
  unfold lap. clear Hin HN. induction own as [|e l IH]; [reflexivity|]. cbn [fold_right]. rewrite IH by (intros; apply Hedge; right; assumption).
  unfold lap_edge. destruct (Nat.eqb_spec (tgt e) i) as [<-|]; [|ring]. rewrite (Hedge e (or_introl eq_refl)). ring.
Qed.
Lemma column_all lam : (forall j, In j C -> j <> top -> column own lam j = 0) -> forall j, In j C -> column own lam j = 0.
Proof.
  intros H j Hj. destruct (Nat.eq_dec j top) as [->|N]; [|apply H; assumption].
  pose proof (column_ok own C Hin HN lam g) as E.
  rewrite (fsum_ext C (fun i => lam i * lap own g i) (fun _ => 0 * 1)) in E by (intros; rewrite lap_gauge; ring).
  rewrite fsum_scal, Rmult_0_l, (fsum_split top C _ HN Htop) in E.
  rewrite (fsum_ext _ _ (fun _ => 0 * 1)) in E.
  2: { intros i Hi. apply filter_In in Hi as [Hi O]. unfold other in O. apply negb_true_iff, Nat.eqb_neq in O. rewrite H by assumption. ring. }
  rewrite fsum_scal in E. pose proof (Hg top Htop) as G. assert (Q : column own lam top * g top = 0) by lra.
  apply Rmult_integral in Q as [Q|Q]; [exact Q|]. rewrite Q in G. lra.
Qed.
Lemma null_exists : exists lam, (exists i, In i C /\ lam i <> 0) /\ forall j, In j C -> column own lam j = 0.
Proof.
  set (ax := fun (j i : nat) => if (i =? j)%nat then 1 else 0).
  destruct (dependent (filter (other top) C) C (fun i j => lap own (ax j) i) HN) as [lam [H1 H2]].
  { rewrite (length_other C top HN Htop). lia. }
  exists lam. split; [exact H1|]. apply column_all. intros j Hj N.
  assert (Ij : In j (filter (other top) C)) by (apply filter_In; split; [exact Hj|unfold other; apply negb_true_iff, Nat.eqb_neq; exact N]).
  specialize (H2 j Ij). rewrite <- (column_ok own C Hin HN) in H2. unfold ax in H2. rewrite <- H2.
  rewrite (fsum_ext C (fun i => column own lam i * _) (fun i => if (j =? i)%nat then column own lam i else 0)).
  - symmetry. apply (fsum_one C j (column own lam) HN Hj).
  - intros i _. rewrite (Nat.eqb_sym i j). destruct (j =? i)%nat; ring.
Qed.
Variables (u : nat -> R).
Let push (j : nat) := esum own (fun e => (if (tgt e =? j)%nat then Rabs (Q2R (wt e)) * u (tgt e) else 0) - if (src e =? j)%nat then Rabs (Q2R (wt e)) * u (tgt e) else 0).
Hypothesis Hu : u top = 0.
Hypothesis Hu' : forall i, In i C -> i <> top -> 0 < u i /\ 0 < push i.
(** the largest multiple of [u] *)
Lemma column_large delta m : delta top = 0 -> 0 <= m -> (forall j, In j C -> j <> top -> Rabs (column own delta j) <= m * push j) ->
  forall i, In i C -> Rabs (delta i) <= m * u i.
Proof.
  intros D0 M0 H i Hi. destruct (Nat.eq_dec i top) as [->|Ni]; [rewrite D0, Hu, Rabs_R0; lra|].
  destruct (largest_of (fun j => Rabs (delta j) / u j) (filter (other top) C)) as [b [Hb Mb]].
  { intros E. assert (K : In i (filter (other top) C)) by (apply filter_In; split; [exact Hi|unfold other; apply negb_true_iff, Nat.eqb_neq; exact Ni]). rewrite E in K. destruct K. }
  apply filter_In in Hb as [Hb Ob]. unfold other in Ob. apply negb_true_iff, Nat.eqb_neq in Ob. destruct (Hu' b Hb Ob) as [Ub Pb].
  set (mu := Rabs (delta b) / u b) in *.
  assert (Mu0 : 0 <= mu) by (unfold mu; apply Rmult_le_pos; [apply Rabs_pos|left; apply Rinv_0_lt_compat; exact Ub]).
  assert (Bd : forall j, In j C -> Rabs (delta j) <= mu * u j).
  { intros j Hj. destruct (Nat.eq_dec j top) as [->|Nj]; [rewrite D0, Hu, Rabs_R0; lra|]. destruct (Hu' j Hj Nj) as [Uj _].
    specialize (Mb j ltac:(apply filter_In; split; [exact Hj|unfold other; apply negb_true_iff, Nat.eqb_neq; exact Nj])).
    apply (Rmult_le_compat_r (u j)) in Mb; [|lra]. unfold Rdiv in Mb at 1. rewrite Rmult_assoc, Rinv_l, Rmult_1_r in Mb by lra. exact Mb. }
  assert (Eb : Rabs (delta b) = mu * u b) by (unfold mu; field; lra).
  destruct (side_of (delta b)) as [sg [G1 G2]].
  assert (P : mu * push b <= sg * column own delta b).
  { unfold push, column. rewrite <- !esum_scal. apply esum_le. intros e He. destruct (Hin e He) as [At _]. specialize (Bd (tgt e) At).
    set (w := Q2R (wt e)). pose proof (Rabs_pos w) as W. apply (Rmult_le_compat_l _ _ _ W) in Bd.
    assert (Q : sg * (w * delta (tgt e)) <= Rabs w * (mu * u (tgt e))).
    { eapply Rle_trans; [|exact Bd]. rewrite <- Rabs_mult. set (v := w * _). pose proof (Rle_abs v). pose proof (Rle_abs (- v)) as V.
      rewrite Rabs_Ropp in V. destruct G1 as [-> | ->]; lra. }
    assert (T : (tgt e = b)%nat -> sg * (Rabs w * delta (tgt e)) = Rabs w * (mu * u (tgt e))).
    { intros ->. rewrite <- Eb, <- G2. ring. }
    destruct (Nat.eqb_spec (tgt e) b) as [Et|_], (src e =? b)%nat; try specialize (T Et); lra. }
  assert (K : mu <= m).
  { apply (Rmult_le_reg_r (push b)); [exact Pb|]. eapply Rle_trans; [exact P|]. eapply Rle_trans; [|apply H; assumption].
    pose proof (Rle_abs (column own delta b)). pose proof (Rle_abs (- column own delta b)) as V. rewrite Rabs_Ropp in V. destruct G1 as [-> | ->]; lra. }
  eapply Rle_trans; [apply Bd; exact Hi|]. destruct (Hu' i Hi Ni) as [Ui _]. apply Rmult_le_compat_r; [lra|exact K].
Qed.
Lemma null_near v m : 0 <= m -> (forall j, In j C -> j <> top -> Rabs (column own v j) <= m * push j) ->
  exists w, (forall j, In j C -> column own w j = 0) /\ forall i, In i C -> Rabs (w i - v i) <= m * u i.
Proof.
  intros M0 H. destruct null_exists as [lam [[q [Hq Nq]] Hl]].
  assert (Nt : lam top <> 0).
  { intros Z. apply Nq. pose proof (column_large lam 0 Z ltac:(lra)) as L. specialize (L ltac:(intros j Hj Nj; rewrite (Hl j Hj), Rabs_R0; lra) q Hq).
    rewrite Rmult_0_l in L. pose proof (Rabs_pos (lam q)). destruct (Req_dec (lam q) 0) as [E|E]; [exact E|]. apply Rabs_no_R0 in E. lra. }
  assert (Lin : forall a b x y j, column own (fun i => a * x i + b * y i) j = a * column own x j + b * column own y j).
  { intros a b x y j. unfold column. rewrite <- !esum_scal. assert (PL : forall l f h, esum l f + esum l h = esum l (fun e => f e + h e)).
    { intros l f h. induction l as [|e l IH]; simpl; [ring|]. rewrite <- IH. ring. } rewrite PL. apply esum_ext. intros e _.
    destruct (tgt e =? j)%nat, (src e =? j)%nat; ring. }
  set (k := v top / lam top). exists (fun i => k * lam i + 0 * lam i). split.
  - intros j Hj. rewrite Lin, (Hl j Hj). ring.
  - apply (column_large (fun i => (k * lam i + 0 * lam i) - v i)); [unfold k; field; exact Nt|exact M0|].
    intros j Hj Nj. assert (E : column own (fun i => k * lam i + 0 * lam i - v i) j = - column own v j).
    { transitivity (column own (fun i => k * lam i + (-1) * v i) j); [|rewrite Lin, (Hl j Hj); ring].
      unfold column. apply esum_ext. intros e _. destruct (tgt e =? j)%nat, (src e =? j)%nat; ring. }
    rewrite E, Rabs_Ropp. apply H; assumption.
Qed.
End Null.

(** * Where the group ends *)
Section Ends.
Variables (own : list edge) (C : list nat) (g U X S : M.t Z) (B : nat -> Z) (v : stated).
Hypothesis H : check_kept own C g U X S B v = true.
Hypothesis HN : NoDup C.
Variables (sf : R) (x0 y xm r : nat -> R).
Hypothesis Hsf : 0 < sf.
Hypothesis HX : forall i, IZR (get X i) = sf * xm i.
Hypothesis HS : forall i, IZR (get S i) = sf * r i.
Hypothesis HB : forall i, In i C -> IZR (B i) = sf * x0 i.
Hypothesis Hy : forall i, In i C -> y i = IZR (get g i) * (IZR (get g (hd O C)) * y (hd O C)).
Hypothesis Hkept : forall w, (forall j, In j C -> column own w j = 0) -> fsum C (fun i => w i * y i) = fsum C (fun i => w i * x0 i).
Theorem kept_ok i : In i C -> Rabs (xm i - y i) <= r i.
Proof.
  intros Hi. unfold check_kept in H. cbv zeta in H. set (ls := common (map wt own)) in *. set (V := by_node (vector_of v)) in *.
  set (rho := left_product ls own V) in *. set (top := fixed v) in *. set (U0 := M.add top 0%Z U) in *. set (push := pushes ls own U0) in *.
  set (rest := filter (other top) C) in *. set (exact := forallb (fun i => get rho i =? 0)%Z C) in *.
  set (m := if exact then _ else _) in *. set (h := hd O C) in *. set (x := (get g h * get X h)%Z) in *.
  set (d := fun i => (B i - x * get g i)%Z). set (D := (_ - fst m * _)%Z) in *.
  change (fun i => (get V i * (B i - x * get g i))%Z) with (fun i => (get V i * d i)%Z) in H.
  change (fun i => (get U0 i * Z.abs (B i - x * get g i))%Z) with (fun i => (get U0 i * Z.abs (d i))%Z) in H.
  set (A := (_ + fst m * _)%Z) in *.
  apply andb_prop in H as [H' H10]. apply andb_prop in H' as [H' H9]. apply andb_prop in H' as [H' H8]. apply andb_prop in H' as [H' H7].
  apply andb_prop in H' as [H' H6]. apply andb_prop in H' as [H' H5]. apply andb_prop in H' as [H' H4]. apply andb_prop in H' as [H' H3].
  apply andb_prop in H' as [H1 H2]. rewrite forallb_forall in H2, H4, H5, H10. apply Z.ltb_lt, IZR_lt in H6, H8. apply Z.leb_le, IZR_le in H7.
  assert (Hin : forall e, In e own -> In (tgt e) C /\ In (src e) C).
  { intros e He. specialize (H2 e He). apply andb_prop in H2 as [P Q]. split; apply marked_In; assumption. }
  apply marked_In in H3. pose proof (weight own H1) as We. pose proof (weight_abs own H1) as Wa. fold ls in We, Wa.
  destruct (good_ok _ _ H1) as [L0 _]. apply IZR_lt in L0. fold ls in L0.
  set (gr := fun i => IZR (get g i)). set (u := fun i => IZR (get U0 i)). set (vr := fun i => IZR (get V i)).
  assert (Hg : forall j, In j C -> gr j * gr j = 1).
  { intros j Hj. specialize (H5 j Hj). apply Z.eqb_eq, (f_equal IZR) in H5. rewrite mult_IZR in H5. exact H5. }
  assert (Hedge : forall e, In e own -> Rabs (Q2R (wt e)) * gr (tgt e) = Q2R (wt e) * gr (src e)).
  { intros e He. specialize (H4 e He). cbv zeta in H4. apply Z.eqb_eq, (f_equal IZR) in H4. rewrite !mult_IZR, (We e He), (Wa e He) in H4.
    unfold gr. apply (Rmult_eq_reg_l (IZR ls)); lra. }
  set (q := IZR (fst m) / IZR (snd m)).
  assert (Q0 : 0 <= q) by (unfold q; apply Rmult_le_pos; [exact H7|left; apply Rinv_0_lt_compat; exact H6]).
  assert (W : exists w, (forall j, In j C -> column own w j = 0) /\ forall j, In j C -> Rabs (w j - vr j) <= q * u j).
  { destruct exact eqn:Ex.
    - exists vr. split.
      + intros j Hj. unfold exact in Ex. rewrite forallb_forall in Ex. specialize (Ex j Hj). apply Z.eqb_eq, (f_equal IZR) in Ex.
        unfold rho, ls in Ex. rewrite (left_entry own V H1) in Ex. fold ls vr in Ex. apply Rmult_integral in Ex as [Ex|Ex]; [lra|exact Ex].
      + intros j _. unfold q, m. simpl. unfold Rminus. rewrite Rplus_opp_r, Rabs_R0. unfold Rdiv. lra.
    - simpl in H9. rewrite forallb_forall in H9.
      set (pr := fun j => esum own (fun e => (if (tgt e =? j)%nat then Rabs (Q2R (wt e)) * u (tgt e) else 0) - if (src e =? j)%nat then Rabs (Q2R (wt e)) * u (tgt e) else 0)).
      assert (Ep : forall j, IZR (get push j) = IZR ls * pr j).
      { intros j. unfold push, pr. clear - We Wa. assert (G : forall l, (forall e, In e l -> In e own) -> IZR (get (pushes ls l U0) j) = IZR ls * esum l (fun e =>
          (if (tgt e =? j)%nat then Rabs (Q2R (wt e)) * u (tgt e) else 0) - if (src e =? j)%nat then Rabs (Q2R (wt e)) * u (tgt e) else 0)).
        { induction l as [|e l IH]; intros Hl; [simpl; rewrite get_empty; simpl; ring|].
          cbn [pushes fold_right esum]. cbv zeta. fold (pushes ls l U0) (esum l). rewrite !get_bump.
          specialize (IH ltac:(intros; apply Hl; right; assumption)). assert (He : In e own) by (apply Hl; left; reflexivity).
          pose proof (Wa e He) as W'. unfold esum, u in *.
          destruct (tgt e =? j)%nat, (src e =? j)%nat; rewrite ?plus_IZR, ?opp_IZR, ?mult_IZR, ?W', IH; ring. }
        apply G. auto. }
      assert (R9 : forall j, In j C -> j <> top -> 0 < u j /\ 0 < pr j /\ Rabs (column own vr j) <= q * pr j).
      { intros j Hj Nj. specialize (H9 j ltac:(apply filter_In; split; [exact Hj|unfold other; apply negb_true_iff, Nat.eqb_neq; exact Nj])).
        apply andb_prop in H9 as [K K3]. apply andb_prop in K as [K1 K2]. apply Z.ltb_lt, IZR_lt in K1, K2. apply Z.leb_le, IZR_le in K3.
        rewrite !mult_IZR, abs_IZR, Ep in K3. rewrite Ep in K2. unfold rho, ls in K3. rewrite (left_entry own V H1) in K3. fold ls vr in K3.
        rewrite Rabs_mult, (Rabs_right (IZR ls)) in K3 by lra.
        assert (P0 : 0 < pr j) by (apply (Rmult_lt_reg_l (IZR ls)); lra).
        split; [unfold u, U0; rewrite get_add; destruct (Nat.eqb_spec top j); [congruence|exact K1]|]. split; [exact P0|].
        apply (Rmult_le_reg_l (IZR ls * IZR (snd m))); [apply Rmult_lt_0_compat; assumption|].
        replace (IZR ls * IZR (snd m) * (q * pr j)) with (IZR (fst m) * (IZR ls * pr j)) by (unfold q; field; lra). lra. }
      apply (null_near own C gr top Hin HN H3 Hg Hedge u); [unfold u, U0; rewrite get_add, Nat.eqb_refl; reflexivity| |exact Q0|].
      + intros j Hj Nj. destruct (R9 j Hj Nj) as [K1 [K2 _]]. split; assumption.
      + intros j Hj Nj. destruct (R9 j Hj Nj) as [_ [_ K3]]. exact K3. }
  destruct W as [w [W1 W2]]. specialize (Hkept w W1). set (c := IZR (get g h) * y h) in *.
  set (xi := gr h * xm h).
  assert (Ex : IZR x = sf * xi) by (unfold x; rewrite mult_IZR, HX; unfold xi, gr; ring).
  set (dr := fun i => x0 i - xi * gr i).
  assert (Ed : forall j, In j C -> IZR (d j) = sf * dr j).
  { intros j Hj. unfold d. rewrite minus_IZR, mult_IZR, (HB j Hj), Ex. unfold dr, gr. ring. }
  (* (c - xi) w'g = w'd *)
  assert (E1 : (c - xi) * fsum C (fun j => w j * gr j) = fsum C (fun j => w j * dr j)).
  { assert (Ey : fsum C (fun j => w j * y j) = c * fsum C (fun j => w j * gr j)).
    { rewrite <- fsum_scal. apply fsum_ext. intros j Hj. rewrite (Hy j Hj). fold c. unfold gr. ring. }
    assert (Ed' : fsum C (fun j => w j * dr j) = fsum C (fun j => w j * x0 j) + - xi * fsum C (fun j => w j * gr j)).
    { rewrite <- fsum_scal, <- fsum_plus. apply fsum_ext. intros j _. unfold dr. ring. }
    rewrite Ed', <- Hkept, Ey. ring. }
  assert (G1 : forall j, In j C -> Rabs (gr j) = 1).
  { intros j Hj. specialize (Hg j Hj). destruct (Rcase_abs (gr j)) as [N|N]; [rewrite (Rabs_left _ N)|rewrite (Rabs_right _ N)]; nra. }
  assert (Low : fsum C (fun j => vr j * gr j) - q * fsum C u <= fsum C (fun j => w j * gr j)).
  { replace (fsum C (fun j => vr j * gr j) - q * fsum C u) with (fsum C (fun j => vr j * gr j) + - q * fsum C u) by ring.
    rewrite <- fsum_scal, <- fsum_plus. apply fsum_le. intros j Hj. pose proof (W2 j Hj) as K. rewrite <- (Rmult_1_r (Rabs _)), <- (G1 j Hj), <- Rabs_mult in K.
    apply Rabs_le_between in K. lra. }
  assert (Up : Rabs (fsum C (fun j => w j * dr j)) <= Rabs (fsum C (fun j => vr j * dr j)) + q * fsum C (fun j => u j * Rabs (dr j))).
  { replace (fsum C (fun j => w j * dr j)) with (fsum C (fun j => vr j * dr j) + fsum C (fun j => (w j - vr j) * dr j))
      by (rewrite <- fsum_plus; apply fsum_ext; intros; ring).
    eapply Rle_trans; [apply Rabs_triang|]. apply Rplus_le_compat_l. rewrite <- fsum_scal. clear - W2. revert W2. generalize C.
    induction C0 as [|a l IH]; intros K; simpl; [rewrite Rabs_R0; lra|]. eapply Rle_trans; [apply Rabs_triang|].
    apply Rplus_le_compat; [|apply IH; intros; apply K; right; assumption]. rewrite Rabs_mult, <- Rmult_assoc.
    apply Rmult_le_compat_r; [apply Rabs_pos|apply K; left; reflexivity]. }
  assert (ED : IZR D = IZR (snd m) * (fsum C (fun j => vr j * gr j) - q * fsum C u)).
  { unfold D. rewrite minus_IZR, !mult_IZR, !zsum_fsum. rewrite (fsum_ext C (fun i => IZR (get V i * get g i)) (fun j => vr j * gr j)) by (intros; apply mult_IZR).
    fold u. unfold q. field. lra. }
  assert (EA : IZR A = sf * IZR (snd m) * (Rabs (fsum C (fun j => vr j * dr j)) + q * fsum C (fun j => u j * Rabs (dr j)))).
  { unfold A. rewrite plus_IZR, !mult_IZR, abs_IZR, !zsum_fsum.
    rewrite (fsum_ext C (fun i => IZR (get V i * d i)) (fun j => sf * (vr j * dr j))) by (intros j Hj; rewrite mult_IZR, (Ed j Hj); unfold vr; ring).
    rewrite (fsum_ext C (fun i => IZR (get U0 i * Z.abs (d i))) (fun j => sf * (u j * Rabs (dr j)))).
    2: { intros j Hj. rewrite mult_IZR, abs_IZR, (Ed j Hj), Rabs_mult, (Rabs_right sf) by lra. unfold u. ring. }
    rewrite !fsum_scal, Rabs_mult, (Rabs_right sf) by lra. unfold q. field. lra. }
  assert (Close : sf * Rabs (c - xi) * IZR D <= IZR A).
  { rewrite EA. set (sw := fsum C (fun j => w j * gr j)) in *. rewrite ED in *. set (lo := fsum C (fun j => vr j * gr j) - q * fsum C u) in *.
    assert (Lo0 : 0 < lo) by (apply (Rmult_lt_reg_l (IZR (snd m))); lra).
    rewrite <- E1, Rabs_mult, (Rabs_right sw) in Up by lra. pose proof (Rabs_pos (c - xi)) as P0.
    assert (K : Rabs (c - xi) * lo <= Rabs (c - xi) * sw) by (apply Rmult_le_compat_l; assumption).
    replace (sf * Rabs (c - xi) * (IZR (snd m) * lo)) with (sf * IZR (snd m) * (Rabs (c - xi) * lo)) by ring.
    apply Rmult_le_compat_l; [apply Rmult_le_pos; lra|lra]. }
  specialize (H10 i Hi). apply Z.leb_le, IZR_le in H10. rewrite plus_IZR, !mult_IZR, abs_IZR, minus_IZR, mult_IZR, HX, HS, Ex in H10.
  replace (IZR (get g i) * (sf * xm i) - sf * xi) with (sf * (gr i * xm i - xi)) in H10 by (unfold gr; ring).
  rewrite Rabs_mult, (Rabs_right sf) in H10 by lra.
  assert (T : Rabs (xm i - y i) <= Rabs (gr i * xm i - xi) + Rabs (c - xi)).
  { rewrite (Hy i Hi). fold c. rewrite <- (Rmult_1_l (Rabs _)), <- (G1 i Hi), <- Rabs_mult.
    replace (gr i * (xm i - IZR (get g i) * c)) with (gr i * xm i - gr i * gr i * c) by (unfold gr; ring). rewrite (Hg i Hi), Rmult_1_l.
    replace (gr i * xm i - c) with ((gr i * xm i - xi) + - (c - xi)) by ring. eapply Rle_trans; [apply Rabs_triang|]. rewrite Rabs_Ropp. lra. }
  apply (Rmult_le_reg_l (sf * IZR D)); [apply Rmult_lt_0_compat; assumption|].
  apply Rle_trans with (sf * IZR D * (Rabs (gr i * xm i - xi) + Rabs (c - xi))); [apply Rmult_le_compat_l; [apply Rmult_le_pos; lra|exact T]|]. lra.
Qed.
End Ends.

(** * Along a motion *)
Lemma kept_sum n es T rho1 k X Sl t0 D (lam : nat -> R) : 0 < T -> motion n (lap es) T rho1 k X Sl -> quiet n T Sl t0 ->
  (forall i, In i D -> (i < n)%nat) -> (forall x, fsum D (fun i => lam i * lap es x i) = 0) ->
  forall t, t0 <= t < T -> fsum D (fun i => lam i * X t i) = fsum D (fun i => lam i * (X 0 i - Sl 0 i)).
Proof.
  intros HT [Dv Ct] [H0 Z] HD H t Ht.
  set (Y := fun u i => X (Rmax 0 u) i - Sl (Rmax 0 u) i).
  assert (EY : forall u, 0 <= u -> Y u = (fun i => X u i - Sl u i)) by (intros u Hu; unfold Y; rewrite Rmax_right by lra; reflexivity).
  transitivity (fsum D (fun i => lam i * Y t i)).
  { apply fsum_ext. intros i Hi. rewrite (EY t) by lra. rewrite Z by (auto; lra). ring. }
  transitivity (fsum D (fun i => lam i * Y 0 i)); [|rewrite (EY 0) by lra; reflexivity].
  assert (DY : forall sg u, 0 < u < T -> is_derive (fun u => sg * fsum D (fun i => lam i * Y u i)) u 0).
  { intros sg u Hu. replace 0 with (sg * (- gain T rho1 k u * fsum D (fun i => lam i * lap es (X u) i))) by (rewrite H; ring).
    apply (is_derive_scal (fun u => fsum D (fun i => lam i * Y u i))). rewrite <- fsum_scal. clear H.
    induction D as [|i l IH]; simpl; [apply (is_derive_const 0)|].
    apply (is_derive_plus (fun u => lam i * Y u i) (fun u => fsum l (fun i => lam i * Y u i))); [|apply IH; intros; apply HD; right; assumption].
    replace (- gain T rho1 k u * (lam i * lap es (X u) i)) with (lam i * - (gain T rho1 k u * lap es (X u) i)) by ring.
    apply (is_derive_scal (fun u => Y u i)). apply (is_derive_ext_loc (fun u => X u i - Sl u i)); [|apply Dv; [exact Hu|apply HD; left; reflexivity]].
    assert (He : 0 < u) by lra. exists (mkposreal u He). intros r Hr.
    unfold ball in Hr; simpl in Hr; unfold AbsRing_ball, abs, minus, plus, opp in Hr; simpl in Hr. apply Rabs_def2 in Hr.
    rewrite EY by lra. reflexivity. }
  assert (CY : forall sg u, 0 <= u < T -> continuous (fun u => sg * fsum D (fun i => lam i * Y u i)) u).
  { intros sg u Hu. apply (continuous_mult (fun _ => sg) (fun u => fsum D (fun i => lam i * Y u i))); [apply continuous_const|]. clear H DY.
    induction D as [|i l IH]; simpl; [apply continuous_const|].
    apply (continuous_plus (fun u => lam i * Y u i) (fun u => fsum l (fun i => lam i * Y u i))); [|apply IH; intros; apply HD; right; assumption].
    apply (continuous_mult (fun _ => lam i) (fun u => Y u i)); [apply continuous_const|]. unfold Y.
    destruct (Ct u i ltac:(lra) (HD i ltac:(left; reflexivity))) as [C1 C2].
    apply (continuous_minus (fun u => X (Rmax 0 u) i) (fun u => Sl (Rmax 0 u) i)); assumption. }
  assert (De : forall sg, sg * fsum D (fun i => lam i * Y t i) <= sg * fsum D (fun i => lam i * Y 0 i)).
  { intros sg. apply (decreasing T 0 (fun u => sg * fsum D (fun i => lam i * Y u i)) (fun _ => 0)); [| | |lra].
    - intros u Hu. apply DY. exact Hu.
    - intros u Hu. apply CY. exact Hu.
    - intros; lra. }
  pose proof (De 1). pose proof (De (-1)). lra.
Qed.
Lemma by_node_at (f : nat -> Z) C i : In i C -> get (by_node (map (fun j => (j, f j)) C)) i = f i.
Proof.
  induction C as [|a C IH]; intros Hi; [destruct Hi|]. cbn [map by_node fold_right fst snd]. rewrite get_add.
  destruct (Nat.eqb_spec a i) as [->|N]; [reflexivity|]. apply IH. destruct Hi as [Hi|Hi]; [contradiction|exact Hi].
Qed.
