package colonnade.column

import chisel3._
import chisel3.util.{RegEnable, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.environment.AttributeStore
import colonnade.formats.{CubeTexel, Load}
import colonnade.shading.CubePort

final class SharedLightCubeIO(config: ColonnadeConfig, columns: Int) extends Bundle {
  val load  = Flipped(Valid(new Load(config))) // only while no frame runs
  val ports = Vec(columns, Flipped(new CubePort))
}

/** The light cube of one or two columns. Each reads in a cycle of its own, so neither waits for the other, and a word
  * comes two cycles after its request. A column requests in every other cycle at most.
  */
final class SharedLightCube(config: ColonnadeConfig, columns: Int) extends Module {
  require(1 <= columns && columns <= SharedLightCube.columns, "columns of a light cube")

  val io = IO(new SharedLightCubeIO(config, columns))

  private val store = AttributeStore(config, "light.cube", io.load)
  private val phase = RegInit(false.B)
  phase := !phase
  private val reads = io.ports.zipWithIndex.map { case (port, index) =>
    val isTurn  = if (columns == 1) true.B else phase === (index == 1).B
    val isEarly = port.read.valid && isTurn
    val waits   = RegNext(port.read.valid && !isTurn, false.B)
    val held    = RegEnable(port.read.bits, port.read.valid)
    assert(!(waits && port.read.valid), "a column requests again while it waits")

    // A word that comes early waits for a cycle
    val comes = RegNext(isEarly, false.B)
    val early = RegEnable(store.word, comes)
    port.word := Mux(RegNext(comes, false.B), early, store.word).asTypeOf(new CubeTexel)
    (isTurn, isEarly || waits, Mux(waits, held, port.read.bits))
  }
  store.read.valid := reads.map(_._2).reduce(_ || _)
  store.read.bits  := Mux(reads.head._1, reads.head._3, reads.last._3)
}

object SharedLightCube {

  /** Columns that share a cube, at most. */
  val columns: Int = 2
}
