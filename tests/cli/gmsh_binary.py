"""Small meshes as gmsh 4.15 writes them in binary: two unit squares beside each other, in one part and in two.

Physical lines are `left`, `right`, `seam` between the squares, and `ends`: left and right together.
"""

from __future__ import annotations

import base64
import zlib

PACKED = {
    "2.2": (
        "c-nQ5OHRWu5J2-!FmMOU${HytRP4&8Y!DS!h{%*gN>XH7LU1rHz(qI$OO`b0IB_R5lI797XU|NWK7y+5cd{)s%dc{t@muCPj>FP*S6VE6s@_"
        "%oTr``a1;v&u;|net*lMv4uep%*OEttdTqr2oK3sAEU8w}??-koxD&5C97awm>Ymofm>r=jh6hpb=66t1F?zclbr#^3tepZzEGd4NF?52r@Q"
        "}T{l(Tq*!;t_qXj(5jNM)o^n!|aD)({%$abXu`&G0g4aj4t-&;qo!(l3akxCEUl}PjQovuuep{$=TeqIQ3)FyPY#D#+tU1Slma)BhH!S1nBt"
        "0Vb(cwFLll>9->2QU6B8q{4@Kd<wWR&=3U1J{R6tKM+p"
    ),
    "4.1": (
        "c-ozmy>8nu5XVJ*S4LhS6G3R`RKRH(WU{j)C{QHuD;PCX3$>j<5>PZ#o+EyUY?*>A+1v-n+9h*}O#N`Hk`h&uN76y6<&M<dkAL2gOb=->J~+"
        "vz!!p@^)x}-Bn;^$=l5~GIlK!QG@#i9YKb#y5r?g0Rk}iIY$%G!4gt^<8<k^RD?Z3gKpu;J5cQB!|Q9+U|#wEvDUX<M5!sP4|%}Sc%cehvhD"
        "a}c}oVo;?DYG(TUg$JmB&_SGA99}lRyp7Lwir)~(PMorOOFXw?w)O}P>azy&A!er9`DX>-d<iScK&#`$#cZG*IKw=&iGSR6(27)2aBqD;Oop"
        "A)>2`unDu-QN&9gn?r+BPByC>=7ixnVp*GG~G8V6Cn`_x`53*!NC^0#UAuFyK>T2!bkB=L??oZW@+h2^u`E=vuJ#+g|U(2%T^MO9D>n8(6l0"
        "K-@#)SGp(F@V1c~igV^%hBI8VR;1=GL7VU8Bl%C2k<JM&c~im;K-EPLEDT%ydL>3@&wSxajCVE<Q3o9_Giu138{CN6qy?j&D?><^&)oP=oi@"
        "Jse1XNQ{pOvOJi+VJ<Y(4%RwSBEI%j+vK=wdgwUcwVe7uG{+#_pU^3tl||APqXS?aurXv1=^7g8gIL$nxV8|;Z~y{ObXU^h1D*>ChAd5wKwb"
        "#ej4V7Kj6Ki*SyK!cG01rVw88iU#K%Bu2aIFDYi@ko*}piEV+{"
    ),
    "2.2, two partitions": (
        "c-n=M&rXCe5XOP>&#LdxG@MOfb>nTltQX^EUx7$hNPsmhiO~o11$+@7!J|hPb_(60Mv|uA%=c?&hBSE;s=VLJChur=m9doFQrB@DnylNx@RD"
        "u$rmCmB-sFu?bV*aTV7wN)jvwST<Fa}#2Yti15_!|hCF7zk6sP^Yd{;@;^*Uqx{Z&+*knG{}L%s;fhjOPSlFhz2Y{z!~`n*wnudqjE-o*H`n"
        "<g)ql6RO2XWn!!8m+I@>Fzl3=>5#RVfN#&$+{MeXgfvI#W1%Ey}Hns2ik*0Al97D`6%zAn7}Omae9SD-N1-7r*k&WGq@1d&}?LA%|;g1g}jg"
        "0*uoKDJ;a__SY3}GmZI}o#}@Y7!Un+N9xf~_0T%zWOA8wU8|e2lKAc~#G)F`"
    ),
    "4.1, two partitions": (
        "c-oy;&2G~`5cXee$Bv1_u_w#&ffG_nsW>IM6d|Ejd4-6$BqBe^wuI=3=O7QkjT7R+tvo=lTsQ+Me}#hCjn`y6yW80HW!IaTZ@-!OcGd|Gqhx"
        "%45zmIHvv<4Wcl>*fswj#R9?VDJw{S3io=hGMr$@tClsNlN$G_tT)95%2$aK#S;>qLjdVbdrl4v-i(|tdP=A$HVb_s59Jc*N(&UgLb<XJRHq"
        "u77=?sfb$ii7ob<t@lcI!PyFW-9q(u~AdXkE(2cHa?$wG8>(<;cX4hi??ZPrhVC7CTGLr<Z-=txjH*}`{31^(zslm?NA@~-YrHPFU9zqWf^@"
        "x-5H!_*(bWsGRL|sVQnzi>s=MZqXFDM1WyOt-ZNax4RgfYD8?nhqB$*mCGmDK7Q`?CCdDF<8Rd+5731N>6OZP7Tkh!in_yA=$h-BCOnaDLfh"
        "FT-AbynBF9Ku%ewe2W6Z11!Em)nFdH(9vRt1_?8Me;WuF?$8v5cz$+y>)nF)gkS`~TA&4u&zEF6Pl@5g&0Ijrey9grL@F3lNX@ledZ{ke}R-"
        "_jiCS<UDyl7o<|<b0BRqEg%)SAHSc+>~+*iv<f-B0qRiK*9N}T>nN|22K2Ea(rW@PYUQheucxRr(zws5yg}}&*I2F@4b<d2!FR#2t)q2}FKe"
        "Nc{{`8n#c&(7awXRy%+oi5Uuev%r|G^d4%}*Kp1zWO3O!m^#=*tY-&T(nt9KjdNv!wkx)SB;oL#rtwa*2wTNQk!*sPy9EN5-d{<Uk>p5IRc`"
        "~6_r@>qOdiYq~M5rjvJ5gBfxeyyT+d<WF+|Elm_5y#m?K6-_kI>^VU(8pXsui19aTFA$&plMIi!||u6Em&&`)*Qi_D_Cm@);z(Qh)Y{=UUU?"
        "@RkHZdE05(*6p@}3<tOK})@d%u@L(FvqIsG)4N1XVlqk{R)sTpaWT^rhLm+Su+3H9vCQ1+t+7MilBEjK=8VFmL{6E9?7P8ksqcJ2OcsBBBB5"
        "v5;LH0J{>Y{fW;pN|^MP>g1x^TVJ"
    ),
}  # fmt: skip


def unpack(version: str) -> bytes:
    """The bytes of a file."""
    return zlib.decompress(base64.b85decode(PACKED[version]))
