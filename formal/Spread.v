(** What a box of initial states takes: the largest value of a Lyapunov function, errors and states, from center and radii. *)
Require Import ZArith QArith Qabs Qreals List Bool Reals Lra Lia Psatz.
From Coquelicot Require Import Coquelicot.
Import ListNotations.
Require Import Vec Definite Graph Certificate Checker Flow Sound Slide Input Effort Peak Reach Moving Measure Course.
Open Scope R_scope.

Lemma notneg_all l : forallb notneg l = true -> forall i, 0 <= Q2R (nth i l 0%Q).
Proof.
  intros H i. destruct (nth_in_or_default i l 0%Q) as [I|E]; [|rewrite E, Q2R_0; lra]. rewrite forallb_forall in H. apply notneg_Q. apply H. exact I.
Qed.
Lemma scaled_app b a r : good b (a ++ r) = true -> good b a = true /\ good b r = true.
Proof.
  unfold good. intros H. apply andb_prop in H as [H0 H]. rewrite forallb_app in H. apply andb_prop in H as [H1 H2]. rewrite H0, H1, H2. auto.
Qed.
(** a row at a state of the box *)
Lemma row_over n w az rz b x : 0 < b -> (length w <= n)%nat -> (forall i, (i < n)%nat -> Rabs (b * x i - IZR (nth i az 0%Z)) <= IZR (nth i rz 0%Z)) ->
  Rabs (b * dot w x) <= IZR (Z.abs (zdot w az) + zdot (map Z.abs w) rz).
Proof.
  intros Hb Hw H. rewrite plus_IZR, abs_IZR. rewrite <- dot_scal.
  rewrite (dot_ext w _ (fun i => vec_of az i + (b * x i - IZR (nth i az 0%Z)))) by (intros; unfold vec_of; ring).
  rewrite dot_plus, zdot_ok. eapply Rle_trans; [apply Rabs_triang|]. apply Rplus_le_compat_l.
  pose proof (dot_sizes w (fun i => b * x i - IZR (nth i az 0%Z)) rz 1 ltac:(lra)) as K. rewrite Rmult_1_r in K. apply K.
  intros i Hi. rewrite Rmult_1_r. apply H. lia.
Qed.

Section Box.
Variables (c : cert) (a r : list Q) (x0 : nat -> R).
Let d := prepare c.
Let n := order c.
Let es := edges c.
Hypothesis Hls : good (dls d) (map wt es) = true.
Hypothesis Hsrc : forall e, In e es -> (src e < n)%nat.
Hypothesis Hfit : fits n (dL d) = true.
Hypotheses (La : (length a <= n)%nat) (Lr : (length r <= n)%nat).
Hypotheses (G : good (common (a ++ r)) (a ++ r) = true) (Ga : good (common a) a = true) (Hr : forallb notneg r = true).
Hypothesis H0 : forall i, (i < n)%nat -> Rabs (x0 i - Q2R (nth i a 0%Q)) <= Q2R (nth i r 0%Q).
Let b := common (a ++ r).
Let az := map (scaled b) a.
Let rz := map (scaled b) r.
Lemma b_pos : 0 < IZR b.
Proof. destruct (good_ok _ _ G) as [B _]. apply IZR_lt in B. exact B. Qed.
Lemma az_ok i : IZR (nth i az 0%Z) = IZR b * Q2R (nth i a 0%Q).
Proof. apply nth_scaled. apply (scaled_app b a r G). Qed.
Lemma rz_ok i : IZR (nth i rz 0%Z) = IZR b * Q2R (nth i r 0%Q).
Proof. apply nth_scaled. apply (scaled_app b a r G). Qed.
Lemma in_box i : (i < n)%nat -> Rabs (IZR b * x0 i - IZR (nth i az 0%Z)) <= IZR (nth i rz 0%Z).
Proof.
  intros Hi. rewrite az_ok, rz_ok. replace (IZR b * x0 i - IZR b * Q2R (nth i a 0%Q)) with (IZR b * (x0 i - Q2R (nth i a 0%Q))) by ring.
  pose proof b_pos. rewrite Rabs_mult, Rabs_right by lra. apply Rmult_le_compat_l; [lra|apply H0; exact Hi].
Qed.
Lemma error_over j : (j < n)%nat -> Rabs (lap es x0 j) <= Q2R (greatest (map (fun y => inject_Z y / inject_Z (dls d * b))%Q (box_rows (dL d) az rz))).
Proof.
  intros Hj. eapply Rle_trans; [|apply (greatest_ok _ j)]. destruct (good_ok _ _ Hls) as [Hl _]. apply IZR_lt in Hl. pose proof b_pos as Pb.
  unfold box_rows. rewrite map_map. set (g := fun w => (inject_Z (Z.abs (zdot w az) + zdot (map Z.abs w) rz) / inject_Z (dls d * b))%Q).
  rewrite nth_indep with (d' := g []) by (rewrite map_length; unfold d; rewrite len_dL; exact Hj). rewrite (map_nth g). unfold g.
  assert (Hin : In (nth j (dL d) []) (dL d)) by (apply nth_In; unfold d; rewrite len_dL; exact Hj).
  destruct (fits_ok _ _ Hfit) as [_ F2]. unfold rows_le in F2. rewrite Forall_forall in F2. specialize (F2 _ Hin).
  pose proof (row_over n (nth j (dL d) []) az rz (IZR b) x0 Pb F2 in_box) as K.
  assert (E : dot (nth j (dL d) []) x0 = IZR (dls d) * lap es x0 j).
  { change (dL d) with (lmat (dls d) es n). unfold lmat. rewrite nth_map_seq by exact Hj. apply lrow_ok. exact Hls. }
  rewrite E in K. assert (Pd : 0 < IZR (dls d * b)) by (rewrite mult_IZR; apply Rmult_lt_0_compat; assumption).
  rewrite Q2R_div, !Q2R_inject by (apply nonzero; rewrite Q2R_inject; lra).
  eapply Rle_trans; [|apply Rle_abs].
  apply (Rmult_le_reg_l (IZR (dls d * b))); [exact Pd|]. unfold Rdiv. rewrite (Rmult_comm (IZR (Z.abs _ + _))), <- Rmult_assoc, Rinv_r, Rmult_1_l by lra.
  eapply Rle_trans; [|exact K]. rewrite mult_IZR, !Rabs_mult, (Rabs_right (IZR b)), (Rabs_right (IZR (dls d))) by lra. right. ring.
Qed.
Lemma state_over j : (j < n)%nat -> Rabs (x0 j) <= Q2R (greatest (map (fun i => Qabs (nth i a 0%Q) + nth i r 0%Q)%Q (seq 0 n))).
Proof.
  intros Hj. eapply Rle_trans; [|apply (greatest_ok _ j)]. rewrite (nth_map_seq (fun i => Qabs (nth i a 0%Q) + nth i r 0%Q)%Q) by exact Hj.
  rewrite Q2R_plus. assert (N : Q2R (Qabs (nth j a 0%Q)) = Rabs (Q2R (nth j a 0%Q))).
  { unfold Q2R. destruct (nth j a 0%Q) as [u v]. simpl. rewrite Rabs_mult, abs_IZR. f_equal. symmetry. apply Rabs_right. apply Rle_ge. left.
    apply Rinv_0_lt_compat. apply IZR_lt. reflexivity. }
  rewrite N. pose proof (notneg_all r Hr j) as R0. pose proof (Rabs_pos (Q2R (nth j a 0%Q))) as A0. rewrite (Rabs_right (_ + _)) by lra.
  replace (x0 j) with (Q2R (nth j a 0%Q) + (x0 j - Q2R (nth j a 0%Q))) by ring. eapply Rle_trans; [apply Rabs_triang|]. specialize (H0 j Hj). lra.
Qed.

(** * The value of a Lyapunov function *)
Variables (f : func) (F : mat) (m : Z).
Hypothesis HF : form n (dls d) (dL d) (ly f) = Some (F, m).
Hypothesis F0 : forall x, 0 <= bil F x x.
Let cut (i : nat) : R := if (i <? n)%nat then x0 i else 0.
Lemma in_cut i : Rabs (IZR b * cut i - IZR (nth i az 0%Z)) <= IZR (nth i rz 0%Z).
Proof.
  unfold cut. destruct (Nat.ltb_spec i n) as [L|L]; [apply in_box; exact L|].
  rewrite !nth_overflow by (unfold az, rz; rewrite map_length; lia). rewrite Rmult_0_r, Rminus_0_r, Rabs_R0. lra.
Qed.
Lemma root_above q v : 0 <= v -> v <= Q2R q -> sqrt v <= Q2R (root q).
Proof.
  intros Hv H. destruct (root_ok q) as [A B]; [lra|]. rewrite <- (sqrt_square _ A). apply sqrt_le_1_alt. unfold sq in B. lra.
Qed.
Theorem value_over_ok : V es (ly f) x0 <= Q2R (value_over c d f a r).
Proof.
  unfold value_over. fold n b az rz. rewrite HF. destruct (rows_of c d f) as [[[A u] P] e] eqn:EA.
  destruct (rows_ok c f F m Hls HF A u P e EA) as [Hu [He [P1 [P2 HV]]]]. destruct (form_ok n _ _ _ _ _ _ Hls eq_refl HF) as [Hm [HFt HFV]].
  destruct (fits_ok _ _ HFt) as [F1 F2]. pose proof b_pos as Pb.
  assert (Nz : forall z : Z, (0 < z)%Z -> ~ (inject_Z z == 0)%Q) by (intros z Hz; unfold Qeq; cbn [Qnum Qden inject_Z]; nia).
  assert (Zb : (0 < b)%Z) by (apply lt_IZR; exact Pb).
  assert (EV : forall x, bil F x x / IZR m = V es (ly f) x) by (intros x; rewrite HFV; apply IZR_lt in Hm; field; lra).
  assert (V0 : forall x, 0 <= V es (ly f) x).
  { intros x. rewrite <- EV. apply Rmult_le_pos; [apply F0|left; apply Rinv_0_lt_compat, IZR_lt; exact Hm]. }
  set (y := box_rows A az rz). set (one := (_ / _)%Q). set (two := (root _ + root _)%Q). cbv zeta.
  assert (K1 : V es (ly f) x0 <= Q2R one).
  { change (V (edges c) (ly f) x0 <= Q2R one). rewrite <- (V_same c f F m Hls HF cut x0) by (intros i Hi; unfold cut; destruct (Nat.ltb_spec i n); [reflexivity|unfold n in *; lia]).
    rewrite HV by (intros i Hi; unfold cut, n; destruct (Nat.ltb_spec i (order c)); [lia|reflexivity]).
    assert (B : forall i, Rabs (dot (nth i A []) cut) <= IZR (nth i y 0%Z) * / IZR b).
    { intros i. assert (D : Rabs (IZR b * dot (nth i A []) cut) <= IZR (nth i y 0%Z)).
      { unfold y, box_rows. destruct (Nat.lt_ge_cases i (length A)) as [L|L].
        - set (g := fun w => (Z.abs (zdot w az) + zdot (map Z.abs w) rz)%Z). rewrite nth_indep with (d' := g []) by (rewrite map_length; exact L). rewrite (map_nth g).
          apply (row_over (length (nth i A [])) (nth i A []) az rz (IZR b) cut Pb (Nat.le_refl _)). intros j _. apply in_cut.
        - rewrite nth_overflow with (l := A) by exact L. simpl. rewrite Rmult_0_r, Rabs_R0. rewrite nth_overflow by (rewrite map_length; exact L). lra. }
      rewrite Rabs_mult, (Rabs_right (IZR b)) in D by lra. apply (Rmult_le_reg_l (IZR b)); [exact Pb|].
      replace (IZR b * (IZR (nth i y 0%Z) * / IZR b)) with (IZR (nth i y 0%Z)) by (field; lra). exact D. }
    pose proof (bil_sizes n y (fun i => dot (nth i A []) cut) (/ IZR b) ltac:(left; apply Rinv_0_lt_compat; exact Pb) (fun i _ => B i)
      P (fun i => dot (nth i A []) cut) y P1 (fun i _ => B i)) as K. apply Rabs_le_between in K. destruct K as [_ K]. fold (sizes P y) in K.
    unfold one. rewrite Q2R_div, !Q2R_inject by (apply Nz; nia). rewrite !mult_IZR. apply IZR_lt in Hu, He.
    apply (Rmult_le_reg_r (IZR e * (IZR u * IZR u))); [apply Rmult_lt_0_compat; nra|].
    replace (bil P (fun i => dot (nth i A []) cut) (fun i => dot (nth i A []) cut) / (IZR e * (IZR u * IZR u)) * (IZR e * (IZR u * IZR u)))
      with (bil P (fun i => dot (nth i A []) cut) (fun i => dot (nth i A []) cut)) by (field; lra).
    replace (IZR (sizes P y) / (IZR e * (IZR u * IZR u) * (IZR b * IZR b)) * (IZR e * (IZR u * IZR u))) with (IZR (sizes P y) * (/ IZR b * / IZR b)) by (field; lra).
    exact K. }
  assert (K2 : V es (ly f) x0 <= Q2R (two * two)).
  { set (ctr := fun i => Q2R (nth i a 0%Q)). set (dev := fun i => x0 i - ctr i).
    pose proof (measure_plus es (ly f) F (IZR m) (IZR_lt _ _ Hm) EV V0 ctr dev) as M. cbv beta in M.
    change es with (edges c) in M. rewrite (V_same c f F m Hls HF (fun i => ctr i + dev i) x0) in M by (intros i _; unfold dev; ring). fold es in M.
    assert (C : sqrt (V es (ly f) ctr) <= Q2R (root (value F m a))).
    { apply root_above; [apply V0|]. rewrite (value_ok n F m a ctr Hm HFt Ga ltac:(reflexivity)), EV. apply Rle_refl. }
    assert (D : sqrt (V es (ly f) dev) <= Q2R (root (inject_Z (sizes F rz) / inject_Z (m * (b * b))))).
    { apply root_above; [apply V0|]. assert (B : forall i, (i < n)%nat -> Rabs (dev i) <= IZR (nth i rz 0%Z) * / IZR b).
      { intros i Hi. rewrite rz_ok. replace (IZR b * Q2R (nth i r 0%Q) * / IZR b) with (Q2R (nth i r 0%Q)) by (field; lra). apply H0. exact Hi. }
      pose proof (bil_sizes n rz dev (/ IZR b) ltac:(left; apply Rinv_0_lt_compat; exact Pb) B F dev rz F2 (fun i Hi => B i (Nat.lt_le_trans _ _ _ Hi F1))) as K.
      apply Rabs_le_between in K. destruct K as [_ K]. fold (sizes F rz) in K. rewrite <- EV.
      rewrite Q2R_div, !Q2R_inject by (apply Nz; nia). rewrite !mult_IZR. apply IZR_lt in Hm. apply (Rmult_le_reg_r (IZR m)); [exact Hm|].
      replace (bil F dev dev / IZR m * IZR m) with (bil F dev dev) by (field; lra).
      replace (IZR (sizes F rz) / (IZR m * (IZR b * IZR b)) * IZR m) with (IZR (sizes F rz) * (/ IZR b * / IZR b)) by (field; lra). exact K. }
    assert (S2 : sqrt (V es (ly f) x0) <= Q2R two) by (unfold two; rewrite Q2R_plus; lra).
    pose proof (sqrt_pos (V es (ly f) x0)) as S0. rewrite Q2R_mult, <- (sqrt_sqrt _ (V0 x0)). apply Rmult_le_compat; assumption. }
  destruct (Qle_bool one (two * two)); assumption.
Qed.
End Box.

(** * One state, or a box *)
Section From.
Variables (c : cert) (x0 : nat -> R).
Let d := prepare c.
Let n := order c.
Let es := edges c.
Hypothesis Hls : good (dls d) (map wt es) = true.
Hypothesis Hsrc : forall e, In e es -> (src e < n)%nat.
Hypothesis Hfit : fits n (dL d) = true.
Hypothesis G : good (common (start c)) (start c) = true.
Hypothesis HO : check_over c = true.
Hypothesis H0 : forall i, (i < n)%nat -> begins c i (x0 i).
Lemma box_parts a r : start_box c = Some (a, r) -> ((length a <= n)%nat /\ (length r <= n)%nat) /\
  good (common (a ++ r)) (a ++ r) = true /\ good (common a) a = true /\ forallb notneg r = true.
Proof.
  intros E. unfold check_over in HO. rewrite E in HO. apply andb_prop in HO as [H H5]. apply andb_prop in H as [H H4].
  apply andb_prop in H as [H H3]. apply andb_prop in H as [H1 H2]. apply Nat.leb_le in H4, H5. auto.
Qed.
Theorem error_from_ok j : (j < n)%nat -> Rabs (lap es x0 j) <= Q2R (error_from c d).
Proof.
  intros Hj. unfold error_from. unfold begins in H0. destruct (start_box c) as [[a r]|] eqn:E.
  - destruct (box_parts a r E) as [_ [B1 [B2 B3]]]. apply (error_over c a r x0 Hls Hfit B1 H0 j Hj).
  - cbv zeta. destruct (good_ok _ _ Hls) as [Hl _]. destruct (good_ok _ _ G) as [Hb _].
    eapply Rle_trans; [|apply (greatest_ok _ j)]. apply Req_le. f_equal.
    set (g := fun r => (inject_Z (zdot r (map (scaled (common (start c))) (start c))) / inject_Z (dls d * common (start c)))%Q).
    rewrite nth_indep with (d' := g []) by (rewrite map_length; unfold d; rewrite len_dL; exact Hj). rewrite (map_nth g). unfold g.
    rewrite Q2R_div, !Q2R_inject by (unfold Qeq; cbn [Qnum Qden inject_Z]; nia).
    unfold d. rewrite (begin_ok c Hls Hsrc G x0 H0 j Hj), mult_IZR. apply IZR_lt in Hl, Hb. fold es d. field. lra.
Qed.
Theorem state_from_ok j : (j < n)%nat -> Rabs (x0 j) <= Q2R (state_from c).
Proof.
  intros Hj. unfold state_from. unfold begins in H0. destruct (start_box c) as [[a r]|] eqn:E.
  - destruct (box_parts a r E) as [_ [_ [_ B3]]]. apply (state_over c a r x0 B3 H0 j Hj).
  - rewrite H0 by exact Hj. apply greatest_ok.
Qed.
Theorem value_from_ok f F m v : form n (dls d) (dL d) (ly f) = Some (F, m) -> (forall x, 0 <= bil F x x) ->
  (start_box c = None -> V es (ly f) x0 <= Q2R v) -> V es (ly f) x0 <= Q2R (value_from c d f v).
Proof.
  intros HF F0 Hv. unfold value_from. unfold begins in H0. destruct (start_box c) as [[a r]|] eqn:E; [|apply Hv; reflexivity].
  destruct (box_parts a r E) as [[B4 B5] [B1 [B2 _]]]. apply (value_over_ok c a r x0 Hls B4 B5 B1 B2 H0 f F m HF F0).
Qed.
End From.
