"""Does the experiment that is proposed end an ambiguity? On sealed cases, beside a random one."""
