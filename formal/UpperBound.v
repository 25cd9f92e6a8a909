(** The upper bound on the rate, algebraically. Let [H], [F] be symmetric forms on the span of finitely many vectors,
    [F >= 0], and [A] map the span into itself. If [2 H(x, A x) >= u H(x, x)], [H(y, y) < 0] for some [y], and
    [2 F(x, A x) >= b F(x, x)], then [b <= u]: at the least [t] with [H + t F >= 0] this form has a zero [x] with
    [F(x, x) > 0], so [0 = 2 (H + t F)(x, A x) - u (H + t F)(x, x) >= t (b - u) F(x, x)]. *)
Require Import List Reals Lra Classical.
Import ListNotations.
Open Scope R_scope.

Definition state := nat -> R.
Definition plus (x y : state) : state := fun i => x i + y i.
Definition times (c : R) (x : state) : state := fun i => c * x i.
Record form (B : state -> state -> R) : Prop := Form {
  sym : forall x y, B x y = B y x;
  add : forall x y z, B (plus x y) z = B x z + B y z;
  mul : forall c x z, B (times c x) z = c * B x z }.
Fixpoint span (l : list state) (x : state) : Prop :=
  match l with [] => x = times 0 (fun _ => 0) | u :: l' => exists y c, span l' y /\ x = plus y (times c u) end.

Lemma add_r B (HB : form B) x y z : B z (plus x y) = B z x + B z y.
Proof. rewrite (sym B HB), (add B HB), (sym B HB x), (sym B HB y). reflexivity. Qed.
Lemma mul_r B (HB : form B) c x z : B z (times c x) = c * B z x.
Proof. rewrite (sym B HB), (mul B HB), (sym B HB x). reflexivity. Qed.
(** [B(y + c u, y + c u)] *)
Lemma expand B (HB : form B) y c u : B (plus y (times c u)) (plus y (times c u)) = B y y + 2 * c * B u y + c * c * B u u.
Proof. rewrite (add B HB), !(add_r B HB), !(mul B HB), !(mul_r B HB), (sym B HB y u). ring. Qed.

(** a nonnegative form is 0 against its zeros *)
Lemma zero_cross B (HB : form B) u y : (forall c, 0 <= B (plus y (times c u)) (plus y (times c u))) -> B u u = 0 -> B u y = 0.
Proof.
  intros H Z. destruct (Req_dec (B u y) 0) as [E|E]; [exact E|]. exfalso.
  specialize (H (- (B y y + 1) / (2 * B u y))). rewrite (expand B HB), Z in H.
  replace (2 * (- (B y y + 1) / (2 * B u y)) * B u y) with (- (B y y + 1)) in H by (field; exact E). lra.
Qed.

(** * If [M] vanishes only where [F] does, [M >= e F] for some [e > 0] *)
Definition nonneg_on (l : list state) (B : state -> state -> R) := forall x, span l x -> 0 <= B x x.
Theorem coercive l : forall M F, form M -> form F -> nonneg_on l M -> nonneg_on l F ->
  (forall x, span l x -> M x x = 0 -> F x x = 0) -> exists e, 0 < e /\ forall x, span l x -> e * F x x <= M x x.
Proof.
  induction l as [|u l IH]; intros M F HM HF M0 F0 Z.
  - exists 1. split; [lra|]. intros x ->. rewrite !(mul M HM), !(mul F HF). lra.
  - assert (Su : forall y c, span l y -> span (u :: l) (plus y (times c u))) by (intros y c Hy; exists y, c; auto).
    assert (S0 : forall y, span l y -> span (u :: l) y).
    { intros y Hy. exists y, 0. split; [exact Hy|]. apply FunctionalExtensionality.functional_extensionality.
      intros i. unfold plus, times. ring. }
    assert (Sz : exists z, span l z /\ forall i, z i = 0).
    { clear. induction l as [|v l [z [Hz E]]]; [exists (times 0 (fun _ => 0)); split; [reflexivity|intros; unfold times; ring]|].
      exists (plus z (times 0 v)). split; [exists z, 0; auto|]. intros i. unfold plus, times. rewrite E. ring. }
    destruct Sz as [z [Hz Ez]].
    assert (Uu : u = plus z (times 1 u)).
    { apply FunctionalExtensionality.functional_extensionality. intros i. unfold plus, times. rewrite Ez. ring. }
    assert (Su' : span (u :: l) u) by (exists z, 1; auto).
    destruct (Rle_lt_or_eq_dec 0 (M u u) (M0 u Su')) as [Mu|Mu].
    + set (p := fun y : state => plus y (times (- (M u y / M u u)) u)).
      assert (Pp : forall x y, p (plus x y) = plus (p x) (p y)).
      { intros x y. unfold p. rewrite (add_r M HM). apply FunctionalExtensionality.functional_extensionality. intros i.
        unfold plus, times. field. lra. }
      assert (Pt : forall c x, p (times c x) = times c (p x)).
      { intros c x. unfold p. rewrite (mul_r M HM). apply FunctionalExtensionality.functional_extensionality. intros i.
        unfold plus, times. field. lra. }
      set (M' := fun x y => M (p x) (p y)). set (F' := fun x y => F (p x) (p y)).
      assert (HM' : form M') by (split; unfold M'; intros; rewrite ?Pp, ?Pt; [apply HM|apply HM|apply HM]).
      assert (HF' : form F') by (split; unfold F'; intros; rewrite ?Pp, ?Pt; [apply HF|apply HF|apply HF]).
      assert (Sp : forall y, span l y -> span (u :: l) (p y)) by (intros; apply Su; assumption).
      destruct (IH M' F' HM' HF') as [e [He E]].
      { intros y Hy. apply M0. auto. } { intros y Hy. apply F0. auto. } { intros y Hy. apply Z. auto. }
      pose proof (F0 u Su') as Fu. exists (Rmin (e / 2) (M u u / (2 * (F u u + 1)))).
      assert (Q : 0 < M u u / (2 * (F u u + 1))) by (apply Rdiv_lt_0_compat; lra).
      split; [apply Rmin_pos; lra|]. intros x [y [c [Hy ->]]]. specialize (E y Hy).
      set (r := Rmin _ _). assert (R1 : r <= e / 2) by apply Rmin_l. assert (R2 : r <= M u u / (2 * (F u u + 1))) by apply Rmin_r.
      assert (R0 : 0 < r) by (apply Rmin_pos; lra). set (k := c + M u y / M u u).
      assert (Ex : plus y (times c u) = plus (p y) (times k u)).
      { apply FunctionalExtensionality.functional_extensionality. intros i. unfold p, plus, times, k. ring. }
      rewrite Ex, (expand M HM), (expand F HF).
      assert (C : M u (p y) = 0) by (unfold p; rewrite (add_r M HM), (mul_r M HM); field; lra). rewrite C.
      unfold M', F' in E. pose proof (F0 _ (Sp y Hy)) as Fp.
      assert (N : 0 <= F (p y) (p y) + 2 * - k * F u (p y) + - k * - k * F u u).
      { rewrite <- (expand F HF). apply F0. exists y, (- (M u y / M u u) + - k). split; [exact Hy|].
        apply FunctionalExtensionality.functional_extensionality. intros i. unfold p, plus, times. ring. }
      assert (K0 : 0 <= k * k) by (apply Rle_0_sqr).
      assert (G1 : r * F (p y) (p y) <= e / 2 * F (p y) (p y)) by (apply Rmult_le_compat_r; assumption).
      assert (G2 : r * (F u u + 1) <= M u u / 2).
      { replace (M u u / 2) with (M u u / (2 * (F u u + 1)) * (F u u + 1)) by (field; lra). apply Rmult_le_compat_r; lra. }
      assert (G3 : r * (k * k * F u u) <= k * k * (M u u / 2)).
      { replace (r * (k * k * F u u)) with (k * k * (r * F u u)) by ring. apply Rmult_le_compat_l; [exact K0|]. lra. }
      assert (G4 : r * (F (p y) (p y) + 2 * k * F u (p y) + k * k * F u u) <= r * (2 * F (p y) (p y) + 2 * (k * k * F u u)))
        by (apply Rmult_le_compat_l; lra).
      lra.
    + symmetry in Mu. pose proof (Z u Su' Mu) as Fu.
      assert (CM : forall y, span l y -> M u y = 0) by (intros y Hy; apply (zero_cross M HM); [intros c; apply M0; apply Su; exact Hy|exact Mu]).
      assert (CF : forall y, span l y -> F u y = 0) by (intros y Hy; apply (zero_cross F HF); [intros c; apply F0; apply Su; exact Hy|exact Fu]).
      destruct (IH M F HM HF) as [e [He E]].
      { intros y Hy. apply M0. auto. } { intros y Hy. apply F0. auto. } { intros y Hy. apply Z. auto. }
      exists e. split; [exact He|]. intros x [y [c [Hy ->]]]. rewrite (expand M HM), (expand F HF), Mu, Fu, (CM y Hy), (CF y Hy).
      specialize (E y Hy). lra.
Qed.

(** * The least [t] with [H + t F >= 0] *)
Lemma combined H F t : form H -> form F -> form (fun x y => H x y + t * F x y).
Proof.
  intros HH HF. split; intros; cbn beta.
  - rewrite (sym H HH), (sym F HF). reflexivity.
  - rewrite (add H HH), (add F HF). ring.
  - rewrite (mul H HH), (mul F HF). ring.
Qed.
Theorem crossing l H F y : form H -> form F -> nonneg_on l F ->
  (exists K, 0 <= K /\ forall x, span l x -> 0 <= H x x + K * F x x) -> span l y -> H y y < 0 ->
  exists t x, 0 < t /\ span l x /\ 0 < F x x /\ (forall z, span l z -> H x z + t * F x z = 0).
Proof.
  intros HH HF F0 [K [K0 HK]] Sy Hy.
  set (E := fun a => a <= 0 /\ forall x, span l x -> 0 <= H x x + - a * F x x).
  destruct (completeness E) as [m [U L]].
  { exists 0. intros a [Ha _]. exact Ha. } { exists (- K). split; [lra|]. intros x Hx. rewrite Ropp_involutive. auto. }
  set (t := - m). assert (m <= 0) by (apply L; intros a [Ha _]; exact Ha).
  assert (T0 : forall x, span l x -> 0 <= H x x + t * F x x).
  { intros x Hx. destruct (Rle_lt_or_eq_dec 0 (F x x) (F0 x Hx)) as [Fx|Fx].
    - assert (M : m <= H x x / F x x).
      { apply L. intros a [_ Ha]. specialize (Ha x Hx). apply (Rmult_le_reg_r (F x x)); [exact Fx|].
        unfold Rdiv. rewrite Rmult_assoc, Rinv_l; lra. }
      apply (Rmult_le_compat_r (F x x)) in M; [|lra]. unfold Rdiv in M. rewrite Rmult_assoc, Rinv_l in M by lra. unfold t. lra.
    - specialize (HK x Hx). rewrite <- Fx in *. lra. }
  pose proof (combined H F t HH HF) as HM. set (M := fun x y => H x y + t * F x y) in *.
  pose proof (T0 y Sy) as Ty. pose proof (F0 y Sy) as Fy.
  assert (tp : 0 < t) by (unfold t in *; destruct (Rle_lt_or_eq_dec m 0 ltac:(assumption)) as [A|A]; [lra|rewrite A in Ty; lra]).
  destruct (classic (forall x, span l x -> M x x = 0 -> F x x = 0)) as [C|C].
  - exfalso. destruct (coercive l M F HM HF T0 F0 C) as [e [He B]].
    assert (Q : forall x, span l x -> 0 <= H x x + (t - e) * F x x) by (intros x Hx; specialize (B x Hx); unfold M in B; lra).
    destruct (Rle_lt_dec e t) as [A|A].
    + assert (X : m + e <= m); [|lra]. apply U. split; [unfold t in A; lra|]. intros x Hx. specialize (Q x Hx).
      replace (- (m + e)) with (t - e) by (unfold t; ring). exact Q.
    + specialize (Q y Sy). assert (0 <= (e - t) * F y y) by (apply Rmult_le_pos; lra). lra.
  - apply not_all_ex_not in C. destruct C as [x C]. apply imply_to_and in C. destruct C as [Sx C].
    apply imply_to_and in C. destruct C as [Mx Fx].
    exists t, x. split; [exact tp|]. split; [exact Sx|]. split; [pose proof (F0 x Sx); lra|]. intros z Sz.
    apply (zero_cross M HM x z); [|exact Mx]. intros c. apply T0. clear - Sx Sz. revert x z Sx Sz.
    induction l as [|u l IH]; intros x z Sx Sz.
    + rewrite Sx, Sz. apply FunctionalExtensionality.functional_extensionality. intros i. unfold plus, times. ring.
    + destruct Sx as [x' [a [Sx ->]]], Sz as [z' [b [Sz ->]]]. exists (plus z' (times c x')), (b + c * a).
      split; [apply IH; assumption|]. apply FunctionalExtensionality.functional_extensionality. intros i. unfold plus, times. ring.
Qed.
Theorem rate_limit l H F A y u b : form H -> form F -> nonneg_on l F ->
  (exists K, 0 <= K /\ forall x, span l x -> 0 <= H x x + K * F x x) -> span l y -> H y y < 0 ->
  (forall x, span l x -> span l (A x)) ->
  (forall x, span l x -> u * H x x <= 2 * H x (A x)) -> (forall x, span l x -> b * F x x <= 2 * F x (A x)) -> b <= u.
Proof.
  intros HH HF F0 HK Sy Hy SA HA FA. destruct (crossing l H F y HH HF F0 HK Sy Hy) as [t [x [t0 [Sx [Fx Z]]]]].
  pose proof (Z x Sx) as Zx. pose proof (Z (A x) (SA x Sx)) as ZA. specialize (HA x Sx). specialize (FA x Sx).
  destruct (Rle_lt_dec b u) as [L|L]; [exact L|]. exfalso.
  assert (P : 0 < t * ((b - u) * F x x)) by (repeat apply Rmult_lt_0_compat; lra).
  assert (Q : t * (b * F x x) <= t * (2 * F x (A x))) by (apply Rmult_le_compat_l; lra).
  assert (R1 : H x x = - (t * F x x)) by lra. rewrite R1 in HA. lra.
Qed.
