package colonnade

import chisel3.Module
import chiseltest.HasTestName
import circt.stage.ChiselStage
import org.scalatest.TestSuite

import java.nio.file.{Files, Path, Paths}

/** Proofs of a module by Yosys and abc (`lab/colonnade_lab/units/proof.py`): for all inputs that meet its assumptions, its
  * assertions hold in the cycles that follow one cycle of reset. A spec is cancelled where Yosys is not installed.
  *
  * A proof also fails if it is empty: nothing is asserted, the assumptions contradict one another, or a `cover` cannot
  * happen. Its files are in `test_run_dir`, in a folder with the test's name.
  */
trait Proofs { this: TestSuite with HasTestName =>

  /** Proves the module in all cycles. */
  def prove(module: => Module): Unit = prove(module, Nil)

  /** Proves the module in the first `cycles` cycles: where a proof of all cycles takes too long. */
  def proveUntil(cycles: Int)(module: => Module): Unit = prove(module, Seq("--cycles", cycles.toString))

  private def prove(module: => Module, options: Seq[String]): Unit = {
    if (!Files.isExecutable(Proofs.python)) cancel("Yosys is not installed: run tools/environment proof")
    Proofs.objection(Proofs.write(module, getTestName), options).foreach(fail(_))
  }
}

object Proofs {
  private val python = Paths.get(".cache/proof-environment/bin/python")

  /** Yosys does not read all of firtool's SystemVerilog. */
  private val firtool = Array(
    "--disable-all-randomization",
    "--lowering-options=disallowLocalVariables,disallowPackedArrays,noAlwaysComb"
  )

  /** Writes a module in a file that is named after it. */
  private def write(module: => Module, folder: String): Path = {
    val text = ChiselStage.emitSystemVerilog(module, firtoolOpts = firtool)
    val top  = raw"(?m)^module (\w+)\(".r.findAllMatchIn(text).map(_.group(1)).toSeq.last
    Files.writeString(Files.createDirectories(Paths.get("test_run_dir", folder)).resolve(s"$top.sv"), text)
  }

  /** What is wrong with a proof; nothing where it holds. */
  private def objection(file: Path, options: Seq[String]): Option[String] = {
    val command = Seq(python.toString, "-m", "colonnade_lab.units.proof", file.toString) ++ options
    val builder = new ProcessBuilder(command: _*).redirectErrorStream(true)
    builder.environment.put("PYTHONPATH", "host:lab")
    val run  = builder.start()
    val text = new String(run.getInputStream.readAllBytes)
    Option.when(run.waitFor() != 0)(text.trim)
  }
}
