"""Master curves: measured curves are shifted along their axes until they form one curve."""
