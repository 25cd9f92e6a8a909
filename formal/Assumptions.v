Require Import Large.
Print Assumptions accepts_sound.
