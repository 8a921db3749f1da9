package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Cat, Mux1H, PriorityEncoder, Reverse}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.Vec3
import colonnade.numbers.Rounding

/** The bounce unit's datapath: rotating vector registers around one multiplier, one adder, and a unit for roots and
  * quotients. [[BounceProgram]] controls it; see `VectorRegister`.
  */
final class BounceDatapath(config: PathConfig) extends Module {
  import VectorRegister.rotate

  private val numbers    = config.numbers
  private val formats    = new BounceFormats(numbers)
  private val shadeBits  = formats.shadeBits
  private val oneBits    = NumberFormats.lightFraction
  private val dotBits    = 2 * shadeBits + 2
  private val scalarBits = formats.etaSquareBits.max(numbers.cosineFraction + 1)

  val io = IO(new BounceDatapathIO(config))

  private val control  = io.control
  private val products = control.products
  private val actions  = control.actions

  private val origin            = VectorRegister(io.request.origin.x.getWidth)
  private val normal            = VectorRegister(formats.componentBits)
  private val faceForwardNormal = VectorRegister(formats.faceForwardBits)
  private val rayDir            = VectorRegister(formats.componentBits)
  private val dir               = VectorRegister(formats.bounceBits)
  private val reflection        = VectorRegister(formats.bounceBits)
  private val context           = Reg(chiselTypeOf(io.request.context))
  private val eta               = Reg(UInt(NumberFormats.etaBits.W))
  private val reflectance       = Reg(UInt((oneBits + 1).W))

  /** Factors of the ray's direction and of the normal in the outgoing direction: |n|² and c at first. */
  private val directionScale = Reg(UInt(formats.directionScaleBits.W))
  private val normalScale    = Reg(SInt(formats.normalScaleBits.W))

  /** |d|² and |n|²·|d|². */
  private val square         = Reg(UInt(formats.squareBits.W))
  private val squaredLengths = Reg(UInt(numbers.rootBits.W))

  private val exponent = Reg(UInt(2.W)) // bits by which |n|² exceeds its least length

  /** First η²; then the cosine while it is shifted; then 2 · (1 − cosine). Schlick's powers have one factor doubled, so
    * that they drop 13 bits like the other products.
    */
  private val scalar = Reg(UInt(scalarBits.W))

  /** Three more than the bits by which the quotient has to move down to become the cosine. */
  private val shiftRight = Reg(UInt(log2Ceil(dotBits + 5).W))

  private val adder = Module(new BounceAdder(config))
  private val sum   = adder.io.sum
  private val total = adder.io.total

  // Scale by the normal's length. The highest bit of its square is one of a dot product's top four
  private val top         = sum.asUInt(dotBits - 1, dotBits - 4)
  private val topExponent = Mux(top(3, 1).orR, 3.U - PriorityEncoder(Reverse(top(3, 1))), 0.U)
  private val scaled      = Rounding.floor(
    Rounding.floor(sum.asUInt(dotBits - 1, 0), shadeBits - 1),
    Mux(actions.latchNormalSquared, topExponent, exponent)
  )

  // Multiplier operands
  private val positive      = Mux(sum < 0.S, 0.U, sum.asUInt(numbers.rootBits - 1, 0)).zext
  private val cosineFactor  = normalScale.asUInt(formats.cosineBits - 1, 0)
  private val twiceCosine   = Cat(cosineFactor, 0.U(1.W)).zext
  private val mantissa      = Mux(square(shadeBits), Rounding.floor(square, 1), square)(shadeBits - 1, 0).zext
  private val normalSquared = directionScale(shadeBits - 1, 0).zext
  private val twicePower    = Cat(sum.asUInt(oneBits, 0), 0.U(1.W)).zext
  private val twiceOneMinusReflectance = (((1 << oneBits).S -& reflectance.zext) << 1).asSInt

  private val Seq(wideDirectionScale, wideEta, longEta, wideScalar) = Seq(directionScale, eta, eta, scalar).map(_.zext)

  private val choices: Seq[(Bool, (SInt, SInt))] = Seq(
    products.squareNormal             -> (normal(0)                -> normal(0)),
    products.dotNormalRay             -> (normal(0)                -> rayDir(0)),
    products.squareRay                -> (rayDir(0)                -> rayDir(0)),
    products.directionScale           -> (wideDirectionScale       -> rayDir(0)),
    products.twiceNormalScale         -> (twiceCosine              -> normal(0)),
    products.normalScale              -> (normalScale              -> normal(0)),
    products.squaredLengths           -> (square.zext              -> normalSquared),
    products.squaredCosine            -> (normalScale              -> cosineFactor.zext),
    products.etaSquared               -> (wideEta                  -> longEta),
    products.etaTerm                  -> (wideScalar               -> positive),
    products.etaCosine                -> (normalScale              -> longEta),
    products.etaNormal                -> (wideDirectionScale       -> longEta),
    products.hemisphereCheck          -> (dir(0)                   -> faceForwardNormal(0)),
    products.scaleOffset              -> (faceForwardNormal(0)     -> io.offset.zext),
    products.normProduct              -> (mantissa                 -> normalSquared),
    products.timesOneMinusCosine      -> (wideScalar               -> positive),
    products.squarePower              -> (twicePower               -> positive),
    products.timesOneMinusReflectance -> (twiceOneMinusReflectance -> positive)
  )

  /** Selects among distinct operands; products that share an operand share its select. */
  private def select(width: Int, operands: Seq[(Bool, SInt)]): SInt = {
    val different = operands.map(_._2).distinct
    Mux1H(different.map(operand => operands.filter(_._2 eq operand).map(_._1).reduce(_ || _) -> operand.pad(width)))
  }
  private val wide = select(formats.wideBits, choices.map { case (when, (wide, _)) => when -> wide })
  private val long =
    select(formats.longDigits * formats.digitBits, choices.map { case (when, (_, long)) => when -> long })

  private val multiplier = Module(new BounceMultiplier(formats))
  private val product    = multiplier.io.product
  multiplier.io.enable  := products.any
  multiplier.io.isFirst := control.isFirst
  multiplier.io.digit   := control.digit
  multiplier.io.wide    := wide
  multiplier.io.long    := long

  // Roots and quotient. While the root is computed, the dot product moves up until its top bit is set
  private val roots     = Module(new BounceRoots(numbers))
  private val dot       = sum.asUInt(dotBits - 1, 0)
  private val isHigh    = sum.asUInt(dotBits - 1)
  private val shiftsUp  = actions.divide && !isHigh
  private val shiftsOut = actions.shiftQuotient && shiftRight > 3.U
  roots.io.startRoot    := actions.startRoot
  roots.io.startCosine  := actions.startCosineRoot && io.status.isPositive
  roots.io.divide       := actions.divide && isHigh
  roots.io.take         := actions.subtractRoot || actions.latchQuotient
  roots.io.discriminant := Rounding.floor(sum.asUInt(numbers.rootBits + 2, 0), 3 - formats.low)
  roots.io.normProduct  := product.asUInt(2 * shadeBits - 1, 0)
  roots.io.exponent     := exponent +& square(shadeBits)
  roots.io.dot          := dot

  // The cosine in a light's format. A quotient that would have to move up is more than one
  private val quotient = scalar(numbers.cosineFraction - 1, 0)
  private val isOne    = shiftRight < 3.U || scalar(numbers.cosineFraction)
  private val cosine   =
    Mux(isOne, (1 << oneBits).U, Rounding.floor(quotient, numbers.cosineFraction - oneBits).pad(oneBits + 1))

  // Adder
  adder.io.actions        := actions
  adder.io.doubles        := shiftsUp
  adder.io.takesRoot      := actions.subtractRoot && roots.io.isReady
  adder.io.product        := product
  adder.io.exponent       := exponent
  adder.io.squaredLengths := squaredLengths
  adder.io.root           := roots.io.root
  adder.io.cosine         := cosine
  adder.io.reflectance    := reflectance
  adder.io.origin         := origin(0)

  io.status.isPositive        := !io.status.isNegative && sum =/= 0.S
  io.status.isNegative        := sum < 0.S
  io.status.rootIsReady       := roots.io.isReady
  io.status.dotIsNormalised   := isHigh
  io.status.quotientIsShifted := shiftRight <= 3.U

  // Scalars
  private val floored = Rounding.floor(product, NumberFormats.etaFraction)
  when(actions.latchNormalSquared) {
    exponent       := topExponent
    directionScale := scaled(shadeBits - 1, 0)
  }
  when(actions.latchCosine)(normalScale := Mux(sum < 0.S, 0.U, scaled(formats.cosineBits - 1, 0)).zext)
  when(actions.latchRaySquared)(square  := Rounding.floor(dot, shadeBits - 1)(formats.squareBits - 1, 0))
  when(actions.latchSquaredLengths) {
    squaredLengths := Rounding.floor(sum.asUInt(formats.lengthBits - 1, 0), formats.low)
  }
  when(actions.latchDirectionScale)(directionScale := floored.asUInt(formats.directionScaleBits - 1, 0))
  when(actions.latchNormalScale)(normalScale       := Rounding.narrow(sum, formats.normalScaleBits))
  when(actions.latchEtaSquared)(scalar             := floored.asUInt(formats.etaSquareBits - 1, 0))
  when(actions.latchQuotient)(scalar               := roots.io.quotient)
  when(actions.oneMinusCosine)(scalar              := Cat(total.asUInt(oneBits, 0), 0.U(1.W)))
  when(actions.startCosineRoot) {
    scalar     := 0.U
    shiftRight := Mux(io.status.isPositive, roots.io.shiftRight, 3.U)
  }
  when(shiftsUp)(shiftRight := shiftRight + 1.U)
  when(shiftsOut) {
    scalar     := Rounding.floor(scalar, 1)
    shiftRight := shiftRight - 1.U
  }

  // Rotate the vectors that are used
  private val outgoing = Rounding.floor(sum, shadeBits - 4)

  private def uses(by: Bool*): Bool = control.digit === 0.U && by.reduce(_ || _)
  when(uses(products.squareNormal, products.dotNormalRay, products.twiceNormalScale, products.normalScale)) {
    rotate(normal, normal(0))
  }
  when(uses(products.dotNormalRay, products.squareRay, products.directionScale))(rotate(rayDir, rayDir(0)))
  when(uses(products.hemisphereCheck, products.scaleOffset))(rotate(faceForwardNormal, faceForwardNormal(0)))
  when(actions.shiftInReflection || actions.shiftInRefraction || uses(products.hemisphereCheck)) {
    rotate(dir, Mux(products.hemisphereCheck, dir(0), Rounding.narrow(outgoing, formats.bounceBits)))
  }
  when(actions.shiftInReflection)(rotate(reflection, outgoing))
  when(actions.shiftInOrigin)(rotate(origin, Cat(total.asUInt, origin(0)(0)).asSInt))

  // The largest component has reached shadeBits bits: |x| ≥ 2^(shadeBits − 1)
  private val isLongest = normal.map { x =>
    val Seq(sign, next) = Seq(shadeBits, shadeBits - 1).map(x.asUInt(_))
    sign =/= next || (sign && !x.asUInt(shadeBits - 2, 0).orR)
  }.reduce(_ || _)
  for (axis <- 0 until 3) {
    when(actions.normaliseNormal && !isLongest) {
      normal(axis) := Rounding.narrow((normal(axis) << 1).asSInt, formats.componentBits)
    }
    when(control.startOver) {
      normal(axis) := (faceForwardNormal(axis) << (shadeBits - NumberFormats.normalBits)).asSInt
    }
  }

  when(control.load) {
    val request = io.request
    for (axis <- 0 until 3) {
      origin(axis)            := request.origin.axes(axis)
      normal(axis)            := request.normal.axes(axis)
      faceForwardNormal(axis) := request.faceForwardNormal.axes(axis)
      rayDir(axis)            := request.dir.axes(axis)
    }
    context     := request.context
    eta         := request.eta.natural
    reflectance := request.reflectance.natural
  }

  // Result
  io.result.context      := context
  io.result.isRefraction := io.isRefraction
  io.result.origin       := Vec3.of(origin)
  io.result.dir          := Vec3.of(dir)
  io.result.reflection   := Vec3.of(reflection)
  io.result.fresnel.raw  := sum.asUInt(oneBits, 0)
}
