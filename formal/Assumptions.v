Require Import Main.
Print Assumptions check_sound.
