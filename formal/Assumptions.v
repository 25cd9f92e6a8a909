Require Import Large FamilyMain Agents.
Print Assumptions accepts_sound.
Print Assumptions accepts_family_sound.
Print Assumptions accepts_agents_sound.
