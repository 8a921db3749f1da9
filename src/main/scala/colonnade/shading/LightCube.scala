package colonnade.shading

import chisel3._
import chisel3.util.{Cat, RegEnable, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.PathConfig
import colonnade.formats.{AttributeMemories, FrameRegisters, Rgb}
import colonnade.numbers.{DigitRecurrence, Normalise}
import colonnade.ray.RayRequest

/** Reads of a column's light cube: a texel's address, and in the next cycle its word. */
final class CubePort extends Bundle {
  val read = Valid(UInt(LightCube.addressBits.W))
  val word = Input(AttributeMemories.cubeTexel)
}

/** Asks for the light that the last ray of a context meets. It comes two cycles later, and stays until the next read. */
final class LightPort(config: PathConfig) extends Bundle {
  val read  = Valid(Context(config))
  val light = Input(Rgb(FrameRegisters.intensity))
}

final class LightCubeIO(config: PathConfig) extends Bundle {
  val ray    = Flipped(Valid(new RayRequest(config))) // rays that are traced; not read within three cycles
  val port   = Flipped(new LightPort(config))
  val memory = new CubePort
}

/** The texel of the light cube in the direction of each context's last ray: docs/gather.md. A ray a cycle. {{{
  *
  * ray ─▶ scaled direction ─▶ face and slopes ─▶ table, by context ─▶ memory
  * }}}
  */
final class LightCube(config: PathConfig) extends Module {
  import LightCube._

  val io = IO(new LightCubeIO(config))

  private val isTraced = io.ray.valid && !io.ray.bits.isShadow
  private val dir      = RegEnable(VecInit(scaled(io.ray.bits.dir.axes)), isTraced)
  private val context  = RegEnable(io.ray.bits.context, isTraced)
  private val texels   = ContextTable(config, UInt(addressBits.W))
  when(RegNext(isTraced, false.B)) { texels.write(context, address(dir)) }

  io.memory.read.valid := RegNext(io.port.read.valid, false.B)
  io.memory.read.bits  := texels.read(io.port.read.bits, io.port.read.valid)
  private val comes = RegNext(io.memory.read.valid, false.B)
  io.port.light := Mux(comes, io.memory.word, RegEnable(io.memory.word, comes))
}

object LightCube {
  private val faceLog = AttributeMemories.cubeLog
  private val dirBits = 8

  val addressBits: Int = 3 + 2 * faceLog

  /** The components, shifted together until the largest magnitude has `dirBits` bits, and floored. */
  private def scaled(dir: Seq[SInt]): Seq[SInt] = {
    val width = dir.head.getWidth
    val zeros = Normalise.countLeadingZeros(dir.map(Normalise.magnitude).reduce(_ | _))._2
    dir.map(component => (component.pad(width + 1) << zeros).asUInt(width, width - dirBits).asSInt)
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
