Require Import Large FamilyMain.
Print Assumptions accepts_sound.
Print Assumptions accepts_family_sound.
