Require Import Large FamilyMain Agents Cascade.
Print Assumptions accepts_sound.
Print Assumptions accepts_family_sound.
Print Assumptions accepts_agents_sound.
Print Assumptions accepts_cascade_sound.
