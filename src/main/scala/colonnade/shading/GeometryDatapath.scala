package colonnade.shading

import chisel3._
import chisel3.util.{Cat, Mux1H, PriorityEncoder, Reverse, Valid}
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{Light, Vec3}
import colonnade.numbers.{Normalise, Rounding}
import colonnade.ray.PermutedFrame

final class GeometryDatapathIO(config: ColonnadeConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new ShaderFormats(numbers)

  val control = Input(new GeometryControl(formats))
  val request = Input(new ShadeRequest(config))

  /** Load this instead. */
  val isRoom = Input(Bool())
  val room   = if (config.hasRoom) Some(Input(new RoomSurface(config))) else None

  /** Shade with the geometric normal. */
  val isFlat    = Input(Bool())
  val light     = Input(new Light(numbers))
  val offset    = Input(UInt((numbers.gridBits - 2).W))
  val unitShift = Input(UInt(NumberFormats.bitLength(numbers.sceneBits).W))

  /** To the multiplier, which answers in the next cycle. */
  val factors = Valid(new Factors(formats))
  val product = Input(SInt(formats.productBits.W))

  /** While the normal is counted: it is zero. */
  val normalIsZero = Output(Bool())

  /** Of the light. */
  val angle   = Output(new Angle(formats))
  val falloff = Output(new FalloffQuestion(numbers))
  val surface = Output(new ShadedSurface(config))
}

/** Vector registers around one multiplier, one adder and one shifter; [[GeometryProgram]] says when each does what.
  *
  * A vector register turns: whoever uses it reads its first component, the others move up, and what enters at the end
  * is a new component or the old one. So after three uses everything is in its place, and no component is selected.
  */
final class GeometryDatapath(config: ColonnadeConfig) extends Module {
  private val numbers    = config.numbers
  private val formats    = new ShaderFormats(numbers)
  private val normalBits = NumberFormats.normalBits

  val io = IO(new GeometryDatapathIO(config))

  private val pointBits = ShaderFormats.originBits(config)

  private val control = io.control

  private def vector(bits: Int): Vec[SInt] = Reg(Vec(3, SInt(bits.W)))

  private def turn(vector: Vec[SInt], entering: SInt): Unit = {
    vector(0) := vector(1)
    vector(1) := vector(2)
    vector(2) := Rounding.narrow(entering, vector(2).getWidth)
  }

  /** Of the ray's frame until it is turned. */
  private val point = vector(pointBits)

  /** First each axis' three normals, of vertex 0 in the low bits; then the way to the light. */
  private val normalsOrToLight = vector(formats.vectorBits.max(3 * normalBits))
  private val geometricNormal  = vector(normalBits)
  private val normal           = vector(formats.normalBits)
  private val weights          = Reg(Vec(3, UInt(numbers.barycentricBits.W)))
  private val slopes           = Reg(Vec(2, SInt(numbers.gridBits.W)))
  private val distance         = Reg(SInt(numbers.gridBits.W))
  private val axis             = Reg(UInt(2.W))
  private val isNegative       = Reg(Bool())
  private val backSide         = Reg(Bool())
  private val context          = Reg(chiselTypeOf(io.request.context))
  private val material         = Reg(chiselTypeOf(io.request.face.material))
  private val isRoom           = if (config.hasRoom) Reg(Bool()) else WireInit(false.B)

  private val sum = Reg(SInt((formats.productBits + 1).W))

  /** What descended below the sum: the highest bit, and whether there was any other. */
  private val below        = Reg(Bool())
  private val belowThat    = Reg(Bool())
  private val rounded      = Reg(SInt(pointBits.W))
  private val shifted      = Reg(SInt(formats.vectorBits.W))
  private val measured     = Reg(UInt((formats.vectorBits - 1).W))
  private val normalZeros  = Reg(UInt(Normalise.exponentBits(formats.vectorBits).W))
  private val lightZeros   = Reg(chiselTypeOf(normalZeros))
  private val normalLength = Reg(UInt(formats.shadeBits.W))
  private val lightLength  = Reg(UInt(formats.shadeBits.W))

  /** How long the lengths' squares are, see [[Angle]]. */
  private val normalExponent = Reg(UInt(2.W))
  private val lightExponent  = Reg(UInt(2.W))
  private val dot            = Reg(UInt(formats.dotBits.W))
  private val isAcute        = Reg(Bool())

  // A length's mantissa and exponent: its square's highest bit is one of the top four
  private val top            = sum.asUInt(formats.dotBits - 1, formats.dotBits - 4)
  private val lengthExponent = Mux(top(3, 1).orR, 3.U - PriorityEncoder(Reverse(top(3, 1))), 0.U)
  private val lengthMantissa = Mux1H(
    (0 to 3).map(k => (lengthExponent === k.U) -> sum.asUInt(k + 2 * formats.shadeBits - 2, k + formats.shadeBits - 1))
  )

  // Factors
  private val scaled = Rounding.floor(shifted, formats.vectorBits - formats.narrowBits)

  private def normalOf(corner: Int): SInt =
    normalsOrToLight(0).asUInt(normalBits * (corner + 1) - 1, normalBits * corner).asSInt

  private def digitsOf(slope: SInt): Seq[SInt] = {
    val size = formats.shadeBits
    val low  = Seq.tabulate(formats.slopeDigits - 1)(i => slope.asUInt(size * (i + 1) - 1, size * i).zext)
    low :+ (slope >> (size * (formats.slopeDigits - 1)))
  }
  private val slopeDigits = slopes.flatMap(digitsOf)

  private val choices: Seq[(Bool, (SInt, SInt))] =
    control.weighted.zipWithIndex.map { case (isCorner, corner) =>
      val weight = Mux(io.isFlat, (if (corner == 0) 1 else 0).S, weights(0).zext)
      isCorner -> (weight -> Mux(io.isFlat, geometricNormal(0), normalOf(corner)))
    } ++ control.slope.zip(slopeDigits).map { case (isDigit, digit) => isDigit -> (distance -> digit) } ++ Seq(
      control.raise   -> (io.offset.zext    -> geometricNormal(0)),
      control.square  -> (scaled            -> scaled),
      control.project -> (scaled            -> Rounding.narrow(normal(0), formats.narrowBits)),
      control.lengths -> (normalLength.zext -> lengthMantissa.zext)
    )
  io.factors.valid       := choices.map(_._1).reduce(_ || _)
  io.factors.bits.wide   := Mux1H(choices.map { case (when, (wide, _)) => when -> wide.pad(formats.wideBits) })
  io.factors.bits.narrow := Mux1H(choices.map { case (when, (_, narrow)) => when -> narrow.pad(formats.narrowBits) })

  // Sum
  private val lowDigit = sum.asUInt(formats.shadeBits - 1, 0)
  private val sumSoFar = Mux(control.first, 0.S, Mux(control.descend, sum >> formats.shadeBits, sum))
  when(control.accumulate) {
    sum       := Rounding.narrow(sumSoFar + io.product, sum.getWidth)
    below     := control.descend && lowDigit(formats.shadeBits - 1)
    belowThat := control.descend && (lowDigit(formats.shadeBits - 2, 0).orR || below || belowThat)
  }

  // Rounding: both kinds of sum are aligned so that the same bits are dropped
  private val slopeDrop  = numbers.shearFraction - formats.shadeBits * (formats.slopeDigits - 1) + 2
  private val normalDrop = NumberFormats.normalFraction
  private val drop       = slopeDrop.max(normalDrop)
  private val slopeSum   = (Cat(sum.asUInt, below, belowThat).asSInt << (drop - slopeDrop)).asSInt
  private val normalSum  = (sum << (drop - normalDrop)).asSInt
  rounded := Rounding.narrow(Rounding.nearestEven(Mux(control.roundSlope, slopeSum, normalSum), drop), rounded.getWidth)

  // Adder: point ± rounded, point ± distance, light - point, or 0 - the number to measure
  private val addToPoint = control.addSlope || control.addDistance || control.addOffset
  private val subtract   = Mux1H(
    Seq(
      control.addDistance                                               -> isNegative,
      control.addOffset                                                 -> backSide,
      (control.pushNormal || control.pushLight || control.measureLight) -> true.B
    )
  )
  private val left  = Mux1H(Seq(addToPoint -> point(0).pad(formats.vectorBits), control.pushLight -> shifted))
  private val right = Mux1H(
    Seq(
      (control.addSlope || control.addOffset) -> rounded,
      control.addDistance                     -> distance,
      control.pushLight                       -> point(0),
      control.pushNormal                      -> Rounding.narrow(sum, formats.normalSumBits),
      control.measureLight                    -> Rounding.narrow(normalsOrToLight(0), formats.vectorBits)
    ).map { case (when, operand) => when -> operand.pad(formats.vectorBits) }
  )
  private val addend = Mux(subtract, ~right, right)
  private val total  = (Cat(left.asUInt, true.B) + Cat(addend.asUInt, subtract))(formats.vectorBits, 1).asSInt

  // Measure: the magnitudes' bits together are as long as the largest of them
  private val magnitude     = Mux(right < 0.S, total, right).asUInt(formats.vectorBits - 2, 0)
  private val (zero, zeros) = Normalise.countLeadingZeros(measured)
  when(control.pushNormal || control.measureLight) {
    measured := Mux(control.startMeasure, 0.U, measured) | magnitude
  }
  when(control.countNormal)(normalZeros := zeros)
  when(control.countLight)(lightZeros   := zeros)
  io.normalIsZero := zero

  // Shifter
  private val toShift = Mux1H(
    control.placeLight.zip(io.light.position.axes).map { case (when, axis) =>
      when -> Rounding.narrow(axis, numbers.sceneBits).pad(formats.vectorBits)
    } ++ Seq(
      control.scaleNormal -> normal(0).pad(formats.vectorBits),
      control.scaleLight  -> Rounding.narrow(normalsOrToLight(0), formats.vectorBits)
    )
  )
  private val shiftBits = io.unitShift.getWidth.max(normalZeros.getWidth)
  private val shift     =
    Mux(
      control.scaleNormal,
      normalZeros.pad(shiftBits),
      Mux(control.scaleLight, lightZeros.pad(shiftBits), io.unitShift)
    )
  private val shiftedNow = (0 until shiftBits).foldLeft(toShift) { (number, bit) =>
    Mux(shift(bit), Rounding.narrow((number << (1 << bit)).asSInt, formats.vectorBits), number)
  }
  when(control.placeLight.asUInt.orR || control.scaleNormal || control.scaleLight)(shifted := shiftedNow)

  // Turn the vectors
  private val turnPoint = (control.turn(0) && axis =/= 2.U) || (control.turn(1) && axis === 0.U)
  when(addToPoint || control.pushLight || turnPoint)(turn(point, Mux(addToPoint, total, point(0))))
  when(control.weighted(2) || control.raise)(turn(geometricNormal, geometricNormal(0)))
  when(control.weighted(2) || control.measureLight || control.scaleLight || control.pushLight) {
    turn(normalsOrToLight, Mux(control.pushLight, total, normalsOrToLight(0)))
  }
  when(control.pushNormal || control.scaleNormal || control.project) {
    turn(
      normal,
      Mux(
        control.pushNormal,
        Mux(backSide, total, right),
        Mux(control.project, normal(0), Rounding.floor(shiftedNow, formats.vectorBits - formats.narrowBits))
      )
    )
  }
  when(control.weighted.asUInt.orR) {
    weights(0) := weights(1)
    weights(1) := weights(2)
    weights(2) := weights(0)
  }

  // Results
  when(control.keepNormalLength) {
    normalLength   := lengthMantissa
    normalExponent := lengthExponent
  }
  when(control.lengths) {
    lightLength   := lengthMantissa
    lightExponent := lengthExponent
  }
  when(control.keepDot) {
    dot     := sum.asUInt(formats.dotBits - 1, 0)
    isAcute := sum > 0.S
  }

  when(control.load) {
    val request = io.request
    val normals = request.face.normals.map(_.axes)
    for (axis <- 0 until 3) {
      point(axis)            := request.ray.origin(axis).integer
      normalsOrToLight(axis) := Cat(normals.reverse.map(_(axis).integer)).asSInt
      geometricNormal(axis)  := request.face.geometricNormal.axes(axis).integer
      weights(axis)          := request.hit.weights(axis).natural
    }
    slopes     := VecInit(request.ray.shear.map(_.integer))
    distance   := request.hit.t.integer
    axis       := request.ray.orientation.axis
    isNegative := request.ray.orientation.negative(2)
    backSide   := request.hit.backSide
    context    := request.context
    material   := request.face.material
    isRoom     := io.isRoom
  }

  // A point of the room is one that its ray has met at once, and with a normal of its own
  for (room <- io.room) when(control.load && io.isRoom) {
    for (axis <- 0 until 3) {
      point(axis)           := room.point.axes(axis).integer
      geometricNormal(axis) := room.normal.axes(axis)
    }
    slopes.foreach(_ := 0.S)
    distance   := 0.S
    axis       := 2.U
    isNegative := false.B
    backSide   := false.B
    context    := room.context
  }

  io.angle.isAcute  := isAcute
  io.angle.dot      := dot
  io.angle.lengths  := sum.asUInt(formats.lengthsBits - 1, 0)
  io.angle.exponent := normalExponent +& lightExponent

  // The light's squared distance has 2 · shadeBits - 1 + lightExponent bits, after its components moved up by lightZeros
  private val moved =
    2 * (formats.vectorBits - 1 - formats.shadeBits) + 2 * formats.shadeBits - 1 - numbers.mantissaBits
  private val squaredBits = moved.S +& lightExponent.zext -& (lightZeros << 1).zext
  io.falloff.reach    := io.light.reachMantissa
  io.falloff.mantissa := lightLength
  io.falloff.exponent := io.light.reachExponent -& squaredBits

  io.surface.context  := context
  io.surface.material := material
  io.surface.isRoom   := isRoom
  io.surface.origin   := Vec3.of(point(0), point(1), point(2))
  io.surface.normal   := Vec3.of[SInt](scaledNormal(0), scaledNormal(1), scaledNormal(2))
  io.surface.isSmooth := !io.isFlat
  io.surface.facing   := Vec3.of[SInt](facing(0), facing(1), facing(2))
  io.surface.backSide := backSide

  // The direction as the slopes give it, from the ray's frame to the object's
  private val one     = (BigInt(1) << (formats.shadeBits - 1)).S((formats.shadeBits + 1).W)
  private val towards = slopes.map(slope =>
    Rounding.narrow(Rounding.floor(slope, numbers.shearFraction - (formats.shadeBits - 1)), formats.shadeBits + 1)
  ) :+ Mux(isNegative, -one, one)
  io.surface.towards := PermutedFrame.back(towards, axis)

  private def scaledNormal(axis: Int): SInt = Rounding.narrow(normal(axis), formats.narrowBits)

  private def facing(axis: Int): SInt = {
    val outward = geometricNormal(axis).pad(normalBits + 1)
    Mux(backSide, -outward, outward)
  }
}
