Require Import Large Agents.
Print Assumptions accepts_sound.
Print Assumptions accepts_agents_sound.
