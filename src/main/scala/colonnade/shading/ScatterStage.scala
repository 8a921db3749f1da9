package colonnade.shading

import chisel3._
import chisel3.util.Cat
import colonnade.common.{ModuloSchedule, Timed}
import colonnade.common.ModuloSchedule.{interval, xyz}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{Lobe, SamplePoint, Vec3}
import colonnade.numbers.{FoldedSquareRoot, Normalise, Rounding}

/** Ports of [[ScatterStage]]. Vectors come and go a component at a time, x first. */
final class ScatterStageIO(config: PathConfig) extends Bundle {
  private val formats = new ShaderFormats(config.numbers)

  val phase = Input(ModuloSchedule.phase())
  val point = Input(new SamplePoint) // in cycle 0

  /** From cycle 1 on. At a mirror or glass, which `isBounce` names in the first of these cycles, the direction counts.
    */
  val isBounce          = Input(Bool())
  val faceForwardNormal = Input(SInt((NumberFormats.normalBits + 1).W))
  val dir               = Input(SInt((formats.shadeBits + 1).W))

  /** From `LobeAxisStage.axis0` on; and its squared length in the cycle `AngleCycles.square`. */
  val axis        = Input(SInt(formats.narrowBits.W))
  val squaredAxis = Input(UInt(formats.dotBits.W))

  /** In three cycles from `ScatterStage.rough` on, and in the fourth: the width of a lobe; the surface is rough. From
    * the fourth to the sixth: it is a mirror or glass.
    */
  val alpha   = Input(UInt(Lobe.alphaBits.W))
  val isRough = Input(Bool())
  val isFacet = Input(Bool())

  val scatter    = Output(ScatterStage.component)                       // from cycle `dir0` on
  val microfacet = Output(Vec(3, SInt((ScatterStage.facetBits + 1).W))) // in cycle `facet0`: it, scaled
}

/** The direction of the ray that gathers light at a surface, by a point s of the unit sphere: docs/gather.md. At a
  * diffuse one n + |n| · s about its normal n, with the cosine as its density; at rough metal a ray of the lobe about
  * its axis. At a rough mirror or glass it is the normal of a microfacet. One every three cycles, by a square root and
  * nine multipliers.
  */
final class ScatterStage(config: PathConfig) extends Module {
  import ScatterStage._

  private val formats = new ShaderFormats(config.numbers)
  private val axis0   = LobeAxisStage.axis0
  private val square  = new AngleCycles(config).square
  require(square == axis0 + 4, "the root starts when the axis is known")

  val io = IO(new ScatterStageIO(config))

  private val schedule = new ModuloSchedule(io.phase)
  import schedule._

  // The point of the sphere: z is linear in u, v is the angle about z
  private val early   = carry(latch(0)(io.point), 18)
  private val late    = carry(early, 21)
  private val quarter = early.at(16).v(SamplePoint.bits - 1, SamplePoint.bits - 2)
  private val angle   = early.at(16).v(SamplePoint.bits - 3, 0)
  private val radius  = latch(16)(VecInit(radii.map(_.U(unitBits.W)))(early.at(16).u))
  private val cosines = latch(Seq(16, 17)) {
    val isBackwards = Seq(quarter(0), !quarter(0)).map(isBackwards => Mux(isBackwards, ~angle, angle))
    VecInit(ScatterStage.cosines.map(_.U(unitBits.W)))(select(Seq(16, 17))(isBackwards(_)))
  }
  private val product = latch(Seq(17, 18))(radius.at(Seq(17, 18)) * cosines.at(Seq(17, 18)))
  private val level   = rounded(product.at(Seq(18, 19)), unit)(unitBits - 1, 0).zext
  private val isMinus = Seq(early.at(18).v.head(2).xorR, late.at(19).v.head(1).asBool)
  private val z       = (((1 << unit) - 1).S((unitBits + 2).W) - Cat(late.at(20).u, 0.U(1.W)).zext)(unitBits, 0).asSInt
  private val point = vector(xyz(18))(axis => if (axis == 2) z else Mux(isMinus(axis), -level, level).pad(unitBits + 1))

  // The axis, and its length
  private val axis   = vector(xyz(axis0))(_ => Rounding.floor(io.axis, formats.shadeBits - axisBits))
  private val length = Module(new FoldedSquareRoot(2 * lengthBits, interval)).io
  length.isStep   := isAt(square)
  length.radicand := Rounding.floor(io.squaredAxis, formats.dotBits - 2 * lengthBits)
  private val root = arriving(length.root, rootCycle, rootCycle + interval - 1)

  // Both are used until the direction is known
  private def held(value: Timed[Vec[SInt]]): Seq[Timed[Vec[SInt]]] =
    Seq.iterate(value, (wide + 1 - value.first) / interval + 1)(now => latch(now.last)(now.at(now.last)))
  private val points = held(point)
  private val axes   = held(axis)

  /** The components of a vector in three cycles, one after the other, or rotated. */
  private def components(values: Seq[Timed[Vec[SInt]]], first: Int, rotation: Int = 0): SInt = {
    val now = values((first - values.head.first) / interval)
    select(xyz(first))(axis => now.at(first + axis)((axis + rotation) % 3))
  }

  // Rough surfaces: the parts along and across the axis
  private val lift = {
    val product = latch(xyz(rough - 8))(components(points, rough - 8) * components(axes, rough - 8))
    val sum     = accumulate(xyz(rough - 7), product.at(xyz(rough - 7)).pad(unitBits + axisBits + 4))(_ + _)
    latch(rough - 4)(Rounding.floor(sum.at(rough - 4) + (1 << unit).S, unit + 1))
  }
  private val liftThen = carry(lift, rough - 1).at(rough - 1)
  private val raised   = latch(rough - 1) {
    val sum = root.at(rough - 1).zext +& liftThen
    Mux(sum < 0.S, 0.U, sum.asUInt)(lengthBits, 0)
  }
  private val lowered = latch(rough - 1)(root.at(rough - 1).zext -& liftThen)
  private val scaling = rough until rough + 3
  private val again   = Wire(UInt((lengthBits + 1).W))
  private val scaled  = latch(scaling) {
    val factors = Seq(raised.at(rough), again, carry(root, rough + 2).at(rough + 2))
    io.alpha * select(scaling)(factors(_).pad(lengthBits + 1))
  }
  again := Rounding.floor(scaled.items(0).at(rough + 1), Lobe.alphaBits)
  private val less  = latch(rough + 2)(Rounding.floor(scaled.items(1).at(rough + 2), Lobe.alphaBits))
  private val along = latch(wide) {
    val ofMetal = carry(lowered, wide).at(wide) -& Mux(io.isFacet, -1.S, less.at(wide).zext)
    Mux(io.isRough, Rounding.narrow(ofMetal, lengthBits + 2), (1 << (lengthBits - 1)).S)
  }
  private val across = latch(wide) {
    Mux(io.isRough, rounded(scaled.items(2).at(wide), Lobe.alphaBits - 1), carry(root, wide).at(wide))
  }
  private val isRough = latch(wide)(io.isRough)
  private val crossed = {
    val products = latch(xyz(wide - 2)) {
      VecInit(Seq((1, 2), (2, 1)).map { case (left, right) =>
        components(points, wide - 2, left) * components(axes, wide - 2, right)
      })
    }
    val now = products.at(xyz(wide - 1))
    latch(xyz(wide - 1))(Rounding.floor(now(0) -& now(1), unit))
  }

  // The direction, with the part across the axis on either side
  private val ofAxis  = latch(xyz(wide + 1))(along.at(xyz(wide + 1)) * components(axes, wide + 1))
  private val ofPoint = latch(xyz(wide + 1)) {
    val metal = delay(crossed, xyz(wide), 1).at(xyz(wide + 1))
    val point = components(points, wide + 1).pad(metal.getWidth)
    across.at(xyz(wide + 1)).zext * Mux(isRough.at(xyz(wide + 1)), metal, point)
  }
  private val isMetal    = delay(arriving(isRough.at(xyz(wide + 1)), xyz(wide + 1)), xyz(wide + 1), 1)
  private val partAcross = {
    val now    = ofPoint.at(xyz(wide + 2))
    val ofLobe = Mux(latch(wide + 1)(io.isFacet).at(xyz(wide + 2)), now >> facetShift, now)
    Mux(isMetal.at(xyz(wide + 2)), ofLobe, (now << diffuseShift).asSInt)
  }
  private val both = latch(xyz(wide + 2)) {
    val now = ofAxis.at(xyz(wide + 2))
    VecInit(Seq(now +& partAcross, now -& partAcross).map { sum =>
      Rounding.narrow(Rounding.floor(sum, dropped), componentBits)
    })
  }

  // If it points below the surface, or away from the ray: at a rough surface the other side of the axis, else the
  // opposite
  private val sideCycle = wide + 3
  private val geometric = {
    val upwards = Rounding.floor(io.faceForwardNormal, NumberFormats.normalBits - sideBits)
    val toEye   = (~Rounding.floor(io.dir, formats.shadeBits - sideBits)).asSInt
    delay(arriving(Mux(io.isBounce, toEye, upwards), xyz(1)), xyz(1), sideCycle - 1).at(xyz(sideCycle))
  }
  private val first  = both.at(xyz(sideCycle))
  private val second = Mux(delay(isMetal, xyz(wide + 2), 1).at(xyz(sideCycle)), first(1), -first(0))
  private val sides  = latch(xyz(sideCycle))(Rounding.floor(first(0), sideDropped) * geometric)
  private val side   =
    accumulate(xyz(sideCycle + 1), sides.at(xyz(sideCycle + 1)).pad(componentBits + sideBits + 2))(_ + _)
  private val isBelow = latch(sideCycle + 4)(side.at(sideCycle + 4) < 0.S)
  private val choices = arriving(VecInit(first(0), second), xyz(sideCycle))
  private val result  = {
    val cycles  = xyz(dir0 - 1)
    val now     = delay(choices, xyz(sideCycle), cycles.head - sideCycle).at(cycles)
    val upwards = Mux(isBelow.at(cycles), now(1), now(0))
    latch(cycles)(Mux(isAt(cycles.last), (upwards.asUInt | 1.U).asSInt, upwards))
  }
  io.scatter := result.at(xyz(dir0))

  // A normal has all of its bits in the longest component
  private val facet       = Rounding.narrow(result.at(xyz(dir0)), facetBits + 1)
  private val longest     = accumulate(xyz(dir0), Mux(facet < 0.S, 0.S -& facet, facet).asUInt(facetBits - 1, 0))(_ | _)
  private val zeros       = Normalise.countLeadingZeros(longest.at(dir0 + 3))._2
  private val shift       = Mux(isAt(dir0 + 3), zeros, latch(dir0 + 3)(zeros).at(Seq(dir0 + 4, dir0 + 5)))
  private val scaledFacet =
    (delay(arriving(facet, xyz(dir0)), xyz(dir0), 3).at(xyz(dir0 + 3)) << shift).asUInt(facetBits, 0).asSInt
  io.microfacet := VecInit(Seq(0, 1).map(axis => latch(dir0 + 3 + axis)(scaledFacet).at(facet0)) :+ scaledFacet)

  private def rounded(x: UInt, bits: Int): UInt = Rounding.floor(x +& (1 << (bits - 1)).U, bits)

  /** Three values that come one after the other, together for an interval after the last of them. */
  private def vector(cycles: Seq[Int])(component: Int => SInt): Timed[Vec[SInt]] = {
    val parts = cycles.zipWithIndex.map { case (cycle, axis) => latch(cycle)(component(axis)) }
    val end   = cycles.last + 1
    latch(end)(VecInit(parts.map(_.at(end))))
  }
}

object ScatterStage {
  private val unit     = SamplePoint.bits // fraction bits of a component of a point of the sphere
  private val unitBits = unit + 1         // of its magnitude

  /** Magnitude bits of the axis, and of its length, which counts in twice its units. */
  private val axisBits     = 11
  private val lengthBits   = 11
  private val diffuseShift = axisBits - unit
  private val facetShift   = Lobe.facetFraction - Lobe.alphaBits + 1 // a lobe is twice as wide
  private val rootCycle    = LobeAxisStage.axis0 + 5 + interval * FoldedSquareRoot.intervals(2 * lengthBits, interval)
  private val dropped      = 2 * axisBits - 11                       // low bits of the sum
  private val sideBits    = 8 // of the geometric normal, with its sign, for the side
  private val sideDropped = 2 // low bits of the direction, for the side

  /** First cycle in which it uses the width of a lobe, for the first of three products. */
  val rough: Int = rootCycle + 1

  private val wide = rough + 3 // its parts along and across the axis are known after this cycle

  /** First cycle of the direction, and of a microfacet's normal. */
  val dir0:   Int = rough + 12
  val facet0: Int = dir0 + 5

  val facetBits: Int = 12 // magnitude bits of the normal of a microfacet

  /** Width of a component of the direction, signed. */
  val componentBits: Int = 14

  def component: SInt = SInt(componentBits.W)

  def dir: Vec3[SInt] = Vec3(component)

  /** By u: the distance of the point from the axis z, with `unit` fraction bits. */
  val radii: Seq[Int] = Seq.tabulate(1 << SamplePoint.bits) { u =>
    val z = (255 - 2 * u) / 256.0
    math.rint(256 * math.sqrt(1 - z * z)).toInt
  }

  /** By the index of a quarter circle: the cosine in the middle of its interval. */
  val cosines: Seq[Int] = Seq.tabulate(1 << (SamplePoint.bits - 2)) { index =>
    math.rint(256 * math.cos((index + 0.5) * math.Pi / 128)).toInt
  }
}
