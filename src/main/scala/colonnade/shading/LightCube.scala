package colonnade.shading

import chisel3._
import chisel3.util.{Cat, RegEnable, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.{ColonnadeConfig, PathConfig}
import colonnade.formats.{AttributeMemories, CubeTexel, Gather, Vec3}
import colonnade.numbers.{DigitRecurrence, Fixed, Normalise, Rounding}
import colonnade.ray.RayFormats

/** Reads of the light cube: a texel's address, and two cycles later its word. */
final class CubePort extends Bundle {
  val read = Valid(UInt(LightCube.addressBits.W))
  val word = Input(AttributeMemories.cubeTexel)
}

object CubePort {
  def apply(config: ColonnadeConfig): Option[CubePort] = Gather(config).map(_ => new CubePort)
}

/** The context whose light is read. */
final class LightRead(config: PathConfig) extends Bundle {
  val context    = Context(config)
  val seesLights = Bool()

  /** The last ray is a Fresnel reflection; the next one of the context may leave in this cycle. */
  val isReflection = Bool()
}

/** Asks for the texel that the last ray of a context meets. It comes five cycles later, and stays until the next's
  * read. Its `isLight` is that the path sees a light.
  */
final class LightPort(config: PathConfig) extends Bundle {
  val read  = Valid(new LightRead(config))
  val texel = Input(new CubeTexel)
}

/** A ray that may leave the object: the direction of a gathered ray, or of a bounce. */
final class LeavingRay(config: PathConfig) extends Bundle {
  val context = Context(config)
  val origin  = Vec3(new Fixed(new RayFormats(config.numbers).scene))
  val dir     = Vec3(SInt(new BounceFormats(config.numbers).bounceBits.W))
}

final class LightCubeIO(config: PathConfig) extends Bundle {
  val parallax = Input(UInt(Gather.parallaxBits.W))

  /** Its context is read two cycles later or after that, after a reflection three. */
  val ray    = Flipped(Valid(new LeavingRay(config)))
  val port   = Flipped(new LightPort(config))
  val memory = new CubePort
}

/** The texel of the light cube in the direction of each context's last ray: docs/gather.md. A ray a cycle. A path that
  * sees lights is told where one is. {{{
  *
  * ray ─┬▶ scaled direction ─▶ sum ─▶ face and slopes ─▶ table, by context ─▶ memory
  *      └▶ offset of origin ────┘
  * }}}
  */
final class LightCube(config: PathConfig) extends Module {
  import LightCube._

  val io = IO(new LightCubeIO(config))

  private val texels   = ContextTable(config, UInt(addressBits.W))
  private val contexts = Seq.iterate((io.ray.valid, io.ray.bits.context), 3) { case (valid, context) =>
    (RegNext(valid, false.B), RegEnable(context, valid))
  }
  private val isNext = contexts(1)._1
  private val dir    = RegEnable(VecInit(scaled(io.ray.bits.dir.axes)), io.ray.valid)
  private val offset = RegEnable(VecInit(io.ray.bits.origin.axes.map(offsetOf)), io.ray.valid)
  private val point  = RegEnable(VecInit(fromMiddle(dir, offset)), isNext)
  when(contexts(2)._1) { texels.write(contexts(2)._2, address(point)) }

  // The table is read at once for a reflection, before the next ray enters it, and else when the last ray has
  private val read      = io.port.read
  private val readsNow  = read.valid && read.bits.isReflection
  private val request   = RegEnable(read.bits, read.valid)
  private val hasRead   = RegNext(read.valid, false.B)
  private val readsThen = hasRead && !request.isReflection
  private val texel     = texels.read(Mux(readsNow, read.bits.context, request.context), readsNow || readsThen)
  assert(!(readsNow && readsThen), "two contexts are read in a cycle")
  for ((valid, context) <- contexts.tail) {
    assert(!(readsNow && valid && context === read.bits.context), "a texel is read before it is known")
    assert(!(readsThen && valid && context === request.context), "a texel is read before it is known")
  }
  private val isOfReflection = RegEnable(request.isReflection, hasRead)
  io.memory.read.valid := RegNext(hasRead, false.B)
  io.memory.read.bits  := Mux(isOfReflection, RegEnable(texel, hasRead), texel)
  private val seesLights = RegEnable(request.seesLights, hasRead)
  private val comes      = RegNext(RegNext(io.memory.read.valid, false.B), false.B)
  private val light      = WireInit(io.memory.word)
  when(!RegEnable(seesLights, io.memory.read.valid)) { light.isLight := false.B }
  io.port.texel := RegEnable(light, comes)

  /** How far from the middle of the object's cube a position is, in 2^-6 of the distance of the surfaces; it is odd. */
  private def offsetOf(position: Fixed): SInt = {
    // The bits that count; the middle has the lowest one that changes
    val coarse = Rounding.saturate(Rounding.floor(position.integer, config.numbers.gridBits - 8), offsetBits + 2)
    val middle = Cat((coarse >> middleLog) -& 1.S, coarse(middleLog - 1, 0)).asSInt
    val steps  = Rounding.saturate((middle >> (io.parallax - 1.U)(Gather.parallaxBits - 1, 0)).asSInt, offsetBits - 1)
    Mux(io.parallax === 0.U, 0.S, Cat(steps, 1.U(1.W)).asSInt)
  }
}

object LightCube {
  private val faceLog = AttributeMemories.cubeLog
  private val dirBits = 8

  /** Of an offset, with its sign, and of the magnitude by which it is multiplied. */
  private val offsetBits = 7
  private val factorBits = 3

  /** Of the middle of the object's cube, where the distance of the surfaces is 2^5. */
  private val middleLog = 4

  val addressBits: Int = 3 + 2 * faceLog

  /** The components, shifted together until the largest magnitude has `dirBits` bits, and floored. */
  private def scaled(dir: Seq[SInt]): Seq[SInt] = {
    val width = dir.head.getWidth
    val zeros = Normalise.countLeadingZeros(dir.map(Normalise.magnitude).reduce(_ | _))._2
    dir.map(component => (component.pad(width + 1) << zeros).asUInt(width, width - dirBits).asSInt)
  }

  /** The direction, from the middle of the object's cube, of the point that a ray meets. */
  private def fromMiddle(dir: Seq[SInt], offset: Seq[SInt]): Seq[SInt] = {
    val sizes =
      dir.map(component => Mux(component < 0.S, ~component, component).asUInt(dirBits - 1, dirBits - factorBits))
    val major = sizes.reduce((a, b) => Mux(a >= b, a, b))
    dir.zip(offset).map { case (component, offset) =>
      Rounding.floor(Cat(component, 1.U(1.W)).asSInt +& offset * major, 2)
    }
  }

  /** The address of the texel that a direction meets: face, row, column. */
  private def address(dir: Seq[SInt]): UInt = {
    val Seq(x, y, z) = dir.map(Normalise.magnitude)
    val isX          = x >= y && x >= z
    val isY          = !isX && y >= z

    def permuted(axis: Int): SInt = Mux(isX, dir(axis), Mux(isY, dir((axis + 1) % 3), dir((axis + 2) % 3)))
    val major                     = Mux(isX, x, Mux(isY, y, z))
    val axis                      = Mux(isX, 0.U(2.W), Mux(isY, 1.U, 2.U))
    Cat(axis, permuted(0) < 0.S, slope(permuted(1), major), slope(permuted(2), major))
  }

  /** Which of the 2^faceLog parts of the range from -major to major holds a component. */
  private def slope(component: SInt, major: UInt): UInt = {
    val bits        = major.getWidth + 1
    val (digits, _) = (0 until faceLog).foldLeft((Seq.empty[Bool], (component +& major.zext).asUInt(bits - 1, 0))) {
      case ((digits, left), _) =>
        val (fits, rest) = DigitRecurrence.step(left, major, bits)
        (digits :+ fits, (rest << 1)(bits - 1, 0))
    }
    Cat(digits)
  }
}
