package colonnade.shading

import chisel3._
import chisel3.util.{Cat, Mux1H}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.Vec3
import colonnade.numbers.{Normalise, Rounding}
import colonnade.ray.PermutedFrame

/** The shader geometry's datapath: rotating vector registers around one multiplier, one adder and one shifter.
  * [[GeometryProgram]] controls it; see `VectorRegister`.
  */
final class GeometryDatapath(config: PathConfig) extends Module {
  import VectorRegister.rotate

  private val numbers    = config.numbers
  private val formats    = new ShaderFormats(numbers)
  private val normalBits = NumberFormats.normalBits

  val io = IO(new GeometryDatapathIO(config))

  private val control = io.control
  private val point   = VectorRegister(ShaderFormats.originBits(config)) // in the ray's frame until it is unpermuted

  /** First the three vertex normals, vertex 0 in each axis' low bits; then the vector to the light. */
  private val normalsOrLight  = VectorRegister(formats.vectorBits.max(3 * normalBits))
  private val geometricNormal = VectorRegister(normalBits)
  private val normal          = VectorRegister(formats.normalBits)
  private val weights         = Reg(Vec(3, UInt(numbers.barycentricBits.W)))
  private val shear           = Reg(Vec(2, SInt(numbers.gridBits.W)))
  private val distance        = Reg(SInt(numbers.gridBits.W))
  private val axis            = Reg(UInt(2.W))
  private val isNegative      = Reg(Bool())
  private val backSide        = Reg(Bool())
  private val context         = Reg(chiselTypeOf(io.request.context))
  private val material        = Reg(MaterialIndex(config))
  private val isEnvironment   = if (config.device.hasEnvironment) Reg(Bool()) else WireInit(false.B)

  private val shifted      = Reg(SInt(formats.vectorBits.W))
  private val measured     = Reg(UInt((formats.vectorBits - 1).W))
  private val normalZeros  = Reg(UInt(Normalise.exponentBits(formats.vectorBits).W))
  private val lightZeros   = Reg(chiselTypeOf(normalZeros))
  private val normalLength = Reg(UInt(formats.shadeBits.W))
  private val lightLength  = Reg(UInt(formats.shadeBits.W))

  /** Exponents of the squared lengths, see [[Angle]]. */
  private val normalExponent = Reg(UInt(2.W))
  private val lightExponent  = Reg(UInt(2.W))
  private val dot            = Reg(UInt(formats.dotBits.W))
  private val isAcute        = Reg(Bool())

  private val accumulator = Module(new GeometryAccumulator(config))
  private val sum         = accumulator.io.sum
  private val rounded     = accumulator.io.rounded
  accumulator.io.accumulate       := control.accumulate
  accumulator.io.startSum         := control.startSum
  accumulator.io.shiftAccumulator := control.shiftAccumulator
  accumulator.io.roundShear       := control.roundShear
  accumulator.io.product          := io.product

  // Multiplier operands
  private val scaled = Rounding.floor(shifted, formats.vectorBits - formats.narrowBits)

  private def vertexNormal(vertex: Int): SInt =
    normalsOrLight(0).asUInt(normalBits * (vertex + 1) - 1, normalBits * vertex).asSInt

  private def digitsOf(factor: SInt): Seq[SInt] = {
    val size = formats.shadeBits
    val low  = Seq.tabulate(formats.shearDigits - 1)(i => factor.asUInt(size * (i + 1) - 1, size * i).zext)
    low :+ (factor >> (size * (formats.shearDigits - 1)))
  }
  private val shearDigits = shear.flatMap(digitsOf)

  private val choices: Seq[(Bool, (SInt, SInt))] =
    control.weightNormal.zipWithIndex.map { case (isVertex, vertex) =>
      val weight = Mux(io.isFlat, (if (vertex == 0) 1 else 0).S, weights(0).zext)
      isVertex -> (weight -> Mux(io.isFlat, geometricNormal(0), vertexNormal(vertex)))
    } ++ control.scaleShear.zip(shearDigits).map { case (isDigit, digit) => isDigit -> (distance -> digit) } ++ Seq(
      control.scaleOffset                      -> (io.offset.zext    -> geometricNormal(0)),
      (control.square || control.squareNormal) -> (scaled            -> scaled),
      control.projectNormal                    -> (scaled            -> Rounding.narrow(normal(0), formats.narrowBits)),
      control.normProduct                      -> (normalLength.zext -> accumulator.io.mantissa.zext)
    )
  io.operands.valid       := choices.map(_._1).reduce(_ || _)
  io.operands.bits.wide   := Mux1H(choices.map { case (when, (wide, _)) => when -> wide.pad(formats.wideBits) })
  io.operands.bits.narrow := Mux1H(choices.map { case (when, (_, narrow)) => when -> narrow.pad(formats.narrowBits) })

  // Adder: point ± rounded, point ± distance, light - point, or 0 - the number to measure
  private val addToPoint = control.addShear || control.addDistance || control.addOffset
  private val subtract   = Mux1H(Seq(
    control.addDistance                                                     -> isNegative,
    control.addOffset                                                       -> backSide,
    (control.shiftInNormal || control.shiftInLight || control.measureLight) -> true.B
  ))
  private val left  = Mux1H(Seq(addToPoint -> point(0).pad(formats.vectorBits), control.shiftInLight -> shifted))
  private val right = Mux1H(Seq(
    (control.addShear || control.addOffset) -> rounded,
    control.addDistance                     -> distance,
    control.shiftInLight                    -> point(0),
    control.shiftInNormal                   -> Rounding.narrow(sum, formats.normalSumBits),
    control.measureLight                    -> Rounding.narrow(normalsOrLight(0), formats.vectorBits)
  ).map { case (when, operand) => when -> operand.pad(formats.vectorBits) })
  private val addend = Mux(subtract, ~right, right)
  private val total  = (Cat(left.asUInt, true.B) + Cat(addend.asUInt, subtract))(formats.vectorBits, 1).asSInt

  // The bitwise or of the components' magnitudes is as long as the largest of them
  private val magnitude     = Mux(right < 0.S, total, right).asUInt(formats.vectorBits - 2, 0)
  private val (zero, zeros) = Normalise.countLeadingZeros(measured)
  when(control.shiftInNormal || control.measureLight) {
    measured := Mux(control.startMeasure, 0.U, measured) | magnitude
  }
  when(control.latchNormalZeros)(normalZeros := zeros)
  when(control.latchLightZeros)(lightZeros   := zeros)
  io.normalIsZero := zero

  // Shifter
  private val toShift = Mux1H(
    control.alignLight.zip(io.light.position.axes).map { case (when, axis) =>
      when -> Rounding.narrow(axis, numbers.sceneBits).pad(formats.vectorBits)
    } ++ Seq(
      control.scaleNormal -> normal(0).pad(formats.vectorBits),
      control.scaleLight  -> Rounding.narrow(normalsOrLight(0), formats.vectorBits)
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
  when(control.alignLight.asUInt.orR || control.scaleNormal || control.scaleLight)(shifted := shiftedNow)

  // Rotate the vectors that are used
  private val unpermutes = (control.unpermute(0) && axis =/= 2.U) || (control.unpermute(1) && axis === 0.U)
  when(addToPoint || control.shiftInLight || unpermutes)(rotate(point, Mux(addToPoint, total, point(0))))
  when(control.weightNormal(2) || control.scaleOffset)(rotate(geometricNormal, geometricNormal(0)))
  when(control.weightNormal(2) || control.measureLight || control.scaleLight || control.shiftInLight) {
    rotate(normalsOrLight, Mux(control.shiftInLight, total, normalsOrLight(0)))
  }
  when(control.shiftInNormal || control.scaleNormal || control.projectNormal) {
    rotate(
      normal,
      Mux(
        control.shiftInNormal,
        Mux(backSide, total, right),
        Mux(control.projectNormal, normal(0), Rounding.floor(shiftedNow, formats.vectorBits - formats.narrowBits))
      )
    )
  }
  when(control.weightNormal.asUInt.orR) {
    weights(0) := weights(1)
    weights(1) := weights(2)
    weights(2) := weights(0)
  }

  // Results
  when(control.latchNormalLength) {
    normalLength   := accumulator.io.mantissa
    normalExponent := accumulator.io.exponent
  }
  when(control.normProduct) {
    lightLength   := accumulator.io.mantissa
    lightExponent := accumulator.io.exponent
  }
  when(control.latchDot) {
    dot     := sum.asUInt(formats.dotBits - 1, 0)
    isAcute := sum > 0.S
  }

  when(control.load) {
    val request = io.request
    val normals = request.face.normals.map(_.axes)
    for (axis <- 0 until 3) {
      point(axis)           := request.ray.origin(axis).integer
      normalsOrLight(axis)  := Cat(normals.reverse.map(_(axis).integer)).asSInt
      geometricNormal(axis) := request.face.geometricNormal.axes(axis).integer
      weights(axis)         := request.hit.weights(axis).natural
    }
    shear         := VecInit(request.ray.shear.map(_.integer))
    distance      := request.hit.t.integer
    axis          := request.ray.orientation.axis
    isNegative    := request.ray.orientation.negative(2)
    backSide      := request.hit.backSide
    context       := request.context
    material      := request.face.material
    isEnvironment := io.isEnvironment
  }

  // A point of the environment enters as a hit at distance 0 with a geometric normal of its own
  for (environment <- io.environment) when(control.load && io.isEnvironment) {
    for (axis <- 0 until 3) {
      point(axis)           := environment.point.axes(axis).integer
      geometricNormal(axis) := environment.normal.axes(axis)
    }
    shear.foreach(_ := 0.S)
    distance   := 0.S
    axis       := 2.U
    isNegative := false.B
    backSide   := false.B
    context    := environment.context
  }

  io.angle.isAcute     := isAcute
  io.angle.dot         := dot
  io.angle.normProduct := sum.asUInt(formats.normProductBits - 1, 0)
  io.angle.exponent    := normalExponent +& lightExponent

  // The light's squared distance has 2 · shadeBits - 1 + lightExponent bits, after a left shift by lightZeros
  private val scale =
    2 * (formats.vectorBits - 1 - formats.shadeBits) + 2 * formats.shadeBits - 1 - numbers.mantissaBits
  private val squaredBits = scale.S +& lightExponent.zext -& (lightZeros << 1).zext
  io.falloff.reference := io.light.reachMantissa
  io.falloff.mantissa  := lightLength
  io.falloff.exponent  := io.light.reachExponent -& squaredBits

  io.surface.context           := context
  io.surface.material          := material
  io.surface.isEnvironment     := isEnvironment
  io.surface.origin            := Vec3.of(point)
  io.surface.normal            := Vec3.of(normal.map(Rounding.narrow(_, formats.narrowBits)))
  io.surface.isSmooth          := !io.isFlat
  io.surface.faceForwardNormal := Vec3.of(geometricNormal.map { component =>
    val outward = component.pad(normalBits + 1)
    Mux(backSide, -outward, outward)
  })
  io.surface.backSide := backSide

  // The ray's direction from its shear factors, from the ray's frame to the object's
  private val one = (BigInt(1) << (formats.shadeBits - 1)).S((formats.shadeBits + 1).W)
  private val dir = shear.map(factor =>
    Rounding.narrow(Rounding.floor(factor, numbers.shearFraction - (formats.shadeBits - 1)), formats.shadeBits + 1)
  ) :+ Mux(isNegative, -one, one)
  io.surface.dir := PermutedFrame.back(dir, axis)
}
